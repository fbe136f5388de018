"""What an answer says, as one record, and one writer for each format: text, HTML, plain data, pandas."""
