"""What several questions share: ranges and limits as they are written, parts kept on disk, true peaks, statistics."""
