"""Compiled code: compilers, cache, and every ctypes binding."""
