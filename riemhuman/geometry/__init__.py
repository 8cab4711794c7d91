"""Manifolds and Riemannian metrics: metric fields, normal fields, products, pull-backs, surfaces."""
