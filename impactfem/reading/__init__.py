"""Files of strangers: what is no plain file or too large is not opened, libraries read apart."""
