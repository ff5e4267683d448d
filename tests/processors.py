"""Environment variables that make this processor compute like an older one."""

PLAIN = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "OPENBLAS_CORETYPE": "Prescott",
}
"""Makes NumPy, BLAS and LAPACK compute as on a processor that has only SSE3."""
