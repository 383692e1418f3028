// The loops of machine_limits.cpp, which includes this once for each instruction set, in a namespace and with a target
// of its own. LIMITS_BYTES is the width of a vector.

typedef double Pack __attribute__((vector_size(LIMITS_BYTES)));

void triad(double* a, const double* b, const double* c, double s, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) a[i] = b[i] + s * c[i];
}

// Ten at a time: each waits for itself alone, and two units of four cycles need eight.
double multiplyAndAdd(std::size_t rounds, double by, double plus) {
  const Pack m = Pack{} + by, p = Pack{} + plus;
  Pack x0 = p, x1 = p + 1.0, x2 = p + 2.0, x3 = p + 3.0, x4 = p + 4.0;
  Pack x5 = p + 5.0, x6 = p + 6.0, x7 = p + 7.0, x8 = p + 8.0, x9 = p + 9.0;
  for (std::size_t n = 0; n < rounds; ++n) {
    x0 = x0 * m + p, x1 = x1 * m + p, x2 = x2 * m + p, x3 = x3 * m + p, x4 = x4 * m + p;
    x5 = x5 * m + p, x6 = x6 * m + p, x7 = x7 * m + p, x8 = x8 * m + p, x9 = x9 * m + p;
  }
  const Pack sum = x0 + x1 + x2 + x3 + x4 + x5 + x6 + x7 + x8 + x9;
  double all = 0.0;
  for (int l = 0; l < LIMITS_BYTES / 8; ++l) all += sum[l];
  return all;
}
