"""Readers of single file formats: bytes → SentMesh or NurbsSurface. They may raise any exception."""
