"""Small linear algebra, unrolled: faster on tiny matrices than calls of LAPACK."""
