"""Code generation for LLVM."""
