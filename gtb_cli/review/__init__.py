"""What changed between two meshes or folders of them: a page to look at, and Markdown to read."""
