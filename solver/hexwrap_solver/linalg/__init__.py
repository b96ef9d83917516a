"""Sparse symmetric matrices of meshes: elimination order, Cholesky factorisation, normal equations."""
