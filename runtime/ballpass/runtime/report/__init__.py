"""The report of an answer as one record, and one writer for each format: text, HTML, plain data, pandas."""
