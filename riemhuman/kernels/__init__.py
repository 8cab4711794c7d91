"""The mathematics as free functions on arrays, differentiable with autograd."""
