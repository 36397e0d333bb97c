"""Stiff stepping through diffrax: solvers, endings, accuracy and `simulate`. Public names are exported by `jaxbiped` itself."""
