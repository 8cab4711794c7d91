"""Manifolds and metrics: metric fields, normal fields, products, pull-backs, surfaces."""
