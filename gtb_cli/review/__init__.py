"""What changed between two meshes or folders of them: a page to look at, Markdown to read, pictures."""
