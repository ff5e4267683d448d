"""Another processor, as far as the environment can make one of this."""

PLAIN = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "OPENBLAS_CORETYPE": "Prescott",
}
"""Makes NumPy, BLAS and LAPACK compute as on one with SSE3 alone."""
