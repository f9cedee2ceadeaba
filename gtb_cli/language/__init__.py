"""Text to patch and back: expressions, lines and columns of errors, reader, writer, schema, templates."""
