"""From symbolic programs to cached, compiled kernels."""
