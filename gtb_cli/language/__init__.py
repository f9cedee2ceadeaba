"""Text to patch and back: expressions, documents with lines, reader, writer, schema, templates."""
