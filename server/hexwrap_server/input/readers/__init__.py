"""Readers of single file formats: bytes → SentMesh or NurbsSurface. They raise whatever they stumble over."""
