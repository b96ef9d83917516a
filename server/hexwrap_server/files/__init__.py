"""Writers: a finished Solution as a file."""
