// The vectorised nearest rotation, compiled once for each instruction set: the including file sets the target,
// MESHLESS_SET and the width of a vector. No branches and the same work for every lane, so that no item's
// result depends on its neighbours. Arithmetic is in double but for the first warm step: with the characteristic
// polynomial in float, every matrix with a gap below about 0.1 |a| (a third of random ones) needs a second method.
#ifndef MESHLESS_SET
#error "set MESHLESS_SET and MESHLESS_BYTES before including rotation_kernel.h"
#endif

#include "double_pack.h"

namespace meshless::rotation_sets::MESHLESS_SET {
namespace {

typedef float NarrowPack __attribute__((vector_size(MESHLESS_BYTES)));
constexpr int kNarrowLanes = 2 * kLanes;
constexpr int kBlock = 128;  // items at a time: in the first-level cache, and enough that the exceptions fill vectors

constexpr int kRootSteps = 6;
constexpr int kMaxSweeps = 12;                // of Jacobi rotations; five do for all but odd input
constexpr double kWellConditionedGap = 2e-6;  // relative to |a|: surely unique above; below it Jacobi decides

constexpr double kPending = 1.0, kSolved = 0.0, kKept = -1.0;

template <class Scalar>
struct Precision;
template <>
struct Precision<float> {
  static constexpr double kAngle = 1e-7;  // [rad] error that a verified lane may have
  static constexpr double kStep2 = 3e-6;  // length^2 of the last Newton step, times the condition number
  static constexpr int kWideSteps = 1;    // in double, after one in float
  // Of |cof a|^2 and of what it lacks to a symmetric inversion's, relative to |a|^4: surely not unique below.
  static constexpr double kLine = 1e-13, kInversion = 1e-13;
  static constexpr double kSmallest = 1e-50, kLargest = 1e40;
};
template <>
struct Precision<double> {
  static constexpr double kAngle = 1e-10;
  static constexpr double kStep2 = 3e-9;
  static constexpr int kWideSteps = 2;
  static constexpr double kLine = 1e-19, kInversion = -1.0;  // rounding hides the latter
  static constexpr double kSmallest = 1e-290, kLargest = 1e290;
};

struct alignas(64) Block {
  double a[9][kBlock];      // row by row, divided by the sum of its absolute entries
  double q[4][kBlock];      // x y z w: the guess, then the rotation
  double start[4][kBlock];  // the guess after a first step
  double state[kBlock];
  double unique[kBlock], warm[kBlock];  // 1 or 0
};

int padded(int count) { return (count + kNarrowLanes - 1) / kNarrowLanes * kNarrowLanes; }

// The matrix of some lanes, by row and column.
struct Matrix {
  Pack a00, a01, a02, a10, a11, a12, a20, a21, a22;
};
MESHLESS_INLINE Matrix matrixAt(const Block& b, int i) {
  return {get(b.a[0] + i), get(b.a[1] + i), get(b.a[2] + i), get(b.a[3] + i), get(b.a[4] + i),
          get(b.a[5] + i), get(b.a[6] + i), get(b.a[7] + i), get(b.a[8] + i)};
}

// What is finite and not zero is divided by the sum of its entries; the others keep their guess, and compute on the
// identity meanwhile.
template <class Scalar>
void normalise(Block& b, int i) {
  Pack sum = all(0.0);
  for (int k = 0; k < 9; ++k) sum += absolute(get(b.a[k] + i));
  const Mask usable = (sum >= Precision<Scalar>::kSmallest) & (sum <= Precision<Scalar>::kLargest);
  const Pack factor = 1.0 / sum;
  for (int k = 0; k < 9; ++k) put(choose(usable, get(b.a[k] + i) * factor, all(k % 4 == 0 ? 1.0 : 0.0)), b.a[k] + i);
  put(choose(usable, all(kPending), all(kKept)), b.state + i);
  put(choose(usable, all(1.0), all(0.0)), b.unique + i);
}

void cleanGuess(Block& b, int i) {
  Pack norm2 = all(0.0);
  for (int k = 0; k < 4; ++k) norm2 += get(b.q[k] + i) * get(b.q[k] + i);
  const Mask usable = (norm2 > 1e-20) & (norm2 < 1e20);
  // A guess that is a rotation up to rounding is kept to the bit.
  const Pack factor = choose(absolute(norm2 - 1.0) < 1e-6, all(1.0), 1.0 / squareRoot(norm2));
  for (int k = 0; k < 4; ++k) put(choose(usable, get(b.q[k] + i) * factor, all(k == 3 ? 1.0 : 0.0)), b.q[k] + i);
}

MESHLESS_INLINE void putWhere(Mask m, Pack x, double* to) { put(choose(m, x, get(to)), to); }

// A Newton step of tr(R^T a) on the rotation vector, from q in place (not normalised).
template <class P>
struct Step {
  P w0, w1, w2;                          // rotation vector
  P trace, minor1, minor2, determinant;  // of the Hessian; the minors' order is as good as any
};
template <class P>
MESHLESS_INLINE Step<P> newtonStep(const P (&a)[9], P& x, P& y, P& z, P& w) {
  const P one = P{} + 1, two = P{} + 2, half = one / two;
  const P s = two / (x * x + y * y + z * z + w * w);
  const P r00 = one - s * (y * y + z * z), r01 = s * (x * y - w * z), r02 = s * (x * z + w * y);
  const P r10 = s * (x * y + w * z), r11 = one - s * (x * x + z * z), r12 = s * (y * z - w * x);
  const P r20 = s * (x * z - w * y), r21 = s * (y * z + w * x), r22 = one - s * (x * x + y * y);
  const P b00 = r00 * a[0] + r10 * a[3] + r20 * a[6], b01 = r00 * a[1] + r10 * a[4] + r20 * a[7];
  const P b02 = r00 * a[2] + r10 * a[5] + r20 * a[8], b10 = r01 * a[0] + r11 * a[3] + r21 * a[6];
  const P b11 = r01 * a[1] + r11 * a[4] + r21 * a[7], b12 = r01 * a[2] + r11 * a[5] + r21 * a[8];
  const P b20 = r02 * a[0] + r12 * a[3] + r22 * a[6], b21 = r02 * a[1] + r12 * a[4] + r22 * a[7];
  const P b22 = r02 * a[2] + r12 * a[5] + r22 * a[8];
  const P g0 = b21 - b12, g1 = b02 - b20, g2 = b10 - b01;
  // Hessian: trace I - symmetric part.
  const P h00 = b11 + b22, h11 = b00 + b22, h22 = b00 + b11;
  const P h01 = -half * (b01 + b10), h02 = -half * (b02 + b20), h12 = -half * (b12 + b21);
  const P c00 = h11 * h22 - h12 * h12, c01 = h02 * h12 - h01 * h22, c02 = h01 * h12 - h02 * h11;
  const P c11 = h00 * h22 - h02 * h02, c12 = h01 * h02 - h00 * h12, c22 = h00 * h11 - h01 * h01;
  const P determinant = h00 * c00 + h01 * c01 + h02 * c02;
  const P inverse = one / determinant;
  const P w0 = inverse * (c00 * g0 + c01 * g1 + c02 * g2);
  const P w1 = inverse * (c01 * g0 + c11 * g1 + c12 * g2);
  const P w2 = inverse * (c02 * g0 + c12 * g1 + c22 * g2);
  // q (1, w/2), the Cayley map: it differs from the exponential by the third order of a step that is small at the end.
  const P v0 = half * w0, v1 = half * w1, v2 = half * w2;
  const P nx = x + w * v0 + y * v2 - z * v1, ny = y + w * v1 + z * v0 - x * v2;
  const P nz = z + w * v2 + x * v1 - y * v0, nw = w - x * v0 - y * v1 - z * v2;
  x = nx, y = ny, z = nz, w = nw;
  return {w0, w1, w2, h00 + h11 + h22, h00, c22, determinant};
}

// From the guess into `start`, in float: what rounding spoils here is repaired by the step in double that follows.
void narrowStep(Block& b, int i) {
  alignas(64) float from[13][kNarrowLanes], to[4][kNarrowLanes];
  for (int k = 0; k < 9; ++k)
    for (int l = 0; l < kNarrowLanes; ++l) from[k][l] = static_cast<float>(b.a[k][i + l]);
  for (int k = 0; k < 4; ++k)
    for (int l = 0; l < kNarrowLanes; ++l) from[9 + k][l] = static_cast<float>(b.q[k][i + l]);
  NarrowPack a[9], q[4];
  __builtin_memcpy(a, from, sizeof(a));
  __builtin_memcpy(q, from[9], sizeof(q));
  newtonStep(a, q[0], q[1], q[2], q[3]);
  __builtin_memcpy(to, q, sizeof(q));
  for (int k = 0; k < 4; ++k)
    for (int l = 0; l < kNarrowLanes; ++l) b.start[k][i + l] = to[k][l];
}

template <class Scalar>
void warmLanes(Block& b, int i) {
  Pack a[9];
  for (int k = 0; k < 9; ++k) a[k] = get(b.a[k] + i);
  Pack x = get(b.start[0] + i), y = get(b.start[1] + i), z = get(b.start[2] + i), w = get(b.start[3] + i);
  for (int step = 1; step < Precision<Scalar>::kWideSteps; ++step) newtonStep(a, x, y, z, w);
  const Step<Pack> last = newtonStep(a, x, y, z, w);
  // Verified: a stationary point with a positive definite Hessian is the maximum. What is left after the last step is
  // of its second order times the condition number (third order where that is small: the bound is a safe one). The
  // Hessian's two larger eigenvalues have a product of at most (trace/2)^2.
  const Mask positive = (last.minor1 > 0.0) & (last.minor2 > 0.0) & (last.determinant > 0.0);
  const Pack smallest = 4.0 * last.determinant / (last.trace * last.trace);
  const Pack length2 = last.w0 * last.w0 + last.w1 * last.w1 + last.w2 * last.w2;
  const Mask verified = positive & (length2 * last.trace <= Precision<Scalar>::kStep2 * smallest) &
                        (smallest > kWellConditionedGap * last.trace) & (get(b.state + i) == kPending);
  const Pack factor = 1.0 / squareRoot(x * x + y * y + z * z + w * w);
  putWhere(verified, x * factor, b.q[0] + i);
  putWhere(verified, y * factor, b.q[1] + i);
  putWhere(verified, z * factor, b.q[2] + i);
  putWhere(verified, w * factor, b.q[3] + i);
  putWhere(verified, all(kSolved), b.state + i);
}

// One Halley step towards the largest root of (x^2 - n2)^2 - 8 d x - 4 c2. All four roots are real, so that it comes
// from above and never passes the root.
MESHLESS_INLINE Pack rootStep(Pack x, Pack n2, Pack d, Pack c2) {
  const Pack u = x * x - n2;
  const Pack p = u * u - 8.0 * d * x - 4.0 * c2;
  const Pack h = x * u - 2.0 * d;  // p' / 4
  const Pack k = u + 2.0 * x * x;  // p'' / 4
  return x - 2.0 * p * h / (8.0 * h * h - p * k);
}

// Coefficients and largest root of each item's quartic. Finding the roots is a chain of dependent divisions: in a loop
// of its own several vectors of items overlap.
struct alignas(64) Quartic {
  double n2[kBlock], d[kBlock], c2[kBlock], root[kBlock];  // |a|^2, det a, |cof a|^2
};

void coefficients(const Block& b, Quartic& quartic, int i) {
  const Matrix a = matrixAt(b, i);
  const Pack a00 = a.a00, a01 = a.a01, a02 = a.a02;
  const Pack a10 = a.a10, a11 = a.a11, a12 = a.a12;
  const Pack a20 = a.a20, a21 = a.a21, a22 = a.a22;
  const Pack n2 =
      a00 * a00 + a01 * a01 + a02 * a02 + a10 * a10 + a11 * a11 + a12 * a12 + a20 * a20 + a21 * a21 + a22 * a22;
  const Pack f00 = a11 * a22 - a12 * a21, f01 = a12 * a20 - a10 * a22, f02 = a10 * a21 - a11 * a20;
  const Pack f10 = a02 * a21 - a01 * a22, f11 = a00 * a22 - a02 * a20, f12 = a01 * a20 - a00 * a21;
  const Pack f20 = a01 * a12 - a02 * a11, f21 = a02 * a10 - a00 * a12, f22 = a00 * a11 - a01 * a10;
  const Pack c2 =
      f00 * f00 + f01 * f01 + f02 * f02 + f10 * f10 + f11 * f11 + f12 * f12 + f20 * f20 + f21 * f21 + f22 * f22;
  const Pack d = a00 * f00 + a01 * f01 + a02 * f02;
  // The root's square is n2 + 2 e, e = s1 s2 + s2 s3 + s3 s1 <= |cof a| times sqrt(3), or 1 for inverted matrices.
  const Pack bound = squareRoot(n2 + choose(d > 0.0, all(3.4641016151377553), all(2.0)) * squareRoot(c2));
  put(n2, quartic.n2 + i), put(d, quartic.d + i), put(c2, quartic.c2 + i), put(bound, quartic.root + i);
}

void largestRoot(Quartic& quartic, int i) {
  const Pack n2 = get(quartic.n2 + i), d = get(quartic.d + i), c2 = get(quartic.c2 + i);
  Pack x = get(quartic.root + i);
  for (int step = 0; step < kRootSteps; ++step) x = rootStep(x, n2, d, c2);
  put(x, quartic.root + i);
}

template <class Scalar>
void eigenvector(Block& b, const Quartic& quartic, int i) {
  const Matrix a = matrixAt(b, i);
  const Pack a00 = a.a00, a01 = a.a01, a02 = a.a02;
  const Pack a10 = a.a10, a11 = a.a11, a12 = a.a12;
  const Pack a20 = a.a20, a21 = a.a21, a22 = a.a22;
  const Pack n2 = get(quartic.n2 + i), d = get(quartic.d + i), c2 = get(quartic.c2 + i), x = get(quartic.root + i);
  // Profile matrix (w x y z) less the root, and its adjugate by pairs of 2x2 minors.
  const Pack m00 = a00 + a11 + a22 - x, m11 = a00 - a11 - a22 - x;
  const Pack m22 = a11 - a00 - a22 - x, m33 = a22 - a00 - a11 - x;
  const Pack m01 = a21 - a12, m02 = a02 - a20, m03 = a10 - a01;
  const Pack m12 = a01 + a10, m13 = a02 + a20, m23 = a12 + a21;
  const Pack s01 = m00 * m11 - m01 * m01, s02 = m00 * m12 - m02 * m01, s03 = m00 * m13 - m03 * m01;
  const Pack s12 = m01 * m12 - m02 * m11, s13 = m01 * m13 - m03 * m11;
  const Pack t01 = m02 * m13 - m12 * m03, t02 = m02 * m23 - m22 * m03, t03 = m02 * m33 - m23 * m03;
  const Pack t12 = m12 * m23 - m22 * m13, t13 = m12 * m33 - m23 * m13, t23 = m22 * m33 - m23 * m23;
  const Pack j00 = m11 * t23 - m12 * t13 + m13 * t12, j01 = m12 * t03 - m01 * t23 - m13 * t02;
  const Pack j02 = m01 * t13 - m11 * t03 + m13 * t01, j03 = m11 * t02 - m01 * t12 - m12 * t01;
  const Pack j11 = m00 * t23 - m02 * t03 + m03 * t02, j12 = m01 * t03 - m00 * t13 - m03 * t01;
  const Pack j13 = m00 * t12 - m01 * t02 + m02 * t01, j22 = m03 * s13 - m13 * s03 + m33 * s01;
  const Pack j23 = m12 * s03 - m02 * s13 - m23 * s01, j33 = m02 * s12 - m12 * s02 + m22 * s01;
  // The column of the largest diagonal entry.
  Pack best = absolute(j00), w = j00, qx = j01, qy = j02, qz = j03;
  const Mask take1 = absolute(j11) > best;
  best = choose(take1, absolute(j11), best), w = choose(take1, j01, w), qx = choose(take1, j11, qx);
  qy = choose(take1, j12, qy), qz = choose(take1, j13, qz);
  const Mask take2 = absolute(j22) > best;
  best = choose(take2, absolute(j22), best), w = choose(take2, j02, w), qx = choose(take2, j12, qx);
  qy = choose(take2, j22, qy), qz = choose(take2, j23, qz);
  const Mask take3 = absolute(j33) > best;
  w = choose(take3, j03, w), qx = choose(take3, j13, qx), qy = choose(take3, j23, qy), qz = choose(take3, j33, qz);

  // Verified: the residual bounds the angle by 2 |residual| / gap, and the gap is at least zeta / n2 with
  // zeta = p'/8 = (s1 + s2)(s1 + s3)(s2 + s3). The root was met from above: no other eigenvalue is as near.
  const Pack zeta = 0.5 * (x * (x * x - n2) - 2.0 * d);
  const Pack e0 = m00 * w + m01 * qx + m02 * qy + m03 * qz, e1 = m01 * w + m11 * qx + m12 * qy + m13 * qz;
  const Pack e2 = m02 * w + m12 * qx + m22 * qy + m23 * qz, e3 = m03 * w + m13 * qx + m23 * qy + m33 * qz;
  const Pack residual2 = e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3;
  const Pack norm2 = w * w + qx * qx + qy * qy + qz * qz;
  const Pack bound = Precision<Scalar>::kAngle * zeta;
  const Mask pending = get(b.state + i) == kPending;
  const Mask verified = (4.0 * residual2 * n2 * n2 <= bound * bound * norm2) &
                        (zeta > kWellConditionedGap * n2 * squareRoot(n2)) & pending;

  // Rank 1: the profile matrix has the eigenvalue |a| twice and -|a| twice. Symmetric inversion: |a|/sqrt(3) three
  // times and -sqrt(3) |a|. Adding the lowest to its diagonal leaves the projector onto the space of the best.
  const Mask line = c2 <= Precision<Scalar>::kLine * n2 * n2;
  const Mask inversion = (d < 0.0) & (n2 * n2 - 3.0 * c2 <= Precision<Scalar>::kInversion * n2 * n2);
  const Pack shift = x + squareRoot(choose(line, n2, 3.0 * n2));
  const Pack gx = get(b.q[0] + i), gy = get(b.q[1] + i), gz = get(b.q[2] + i), gw = get(b.q[3] + i);
  const Pack pw = (m00 + shift) * gw + m01 * gx + m02 * gy + m03 * gz;
  const Pack px = m01 * gw + (m11 + shift) * gx + m12 * gy + m13 * gz;
  const Pack py = m02 * gw + m12 * gx + (m22 + shift) * gy + m23 * gz;
  const Pack pz = m03 * gw + m13 * gx + m23 * gy + (m33 + shift) * gz;
  const Pack projected2 = pw * pw + px * px + py * py + pz * pz;
  const Mask kept = (line | inversion) & (projected2 > 1e-6 * n2) & pending;

  const Pack dot = qx * gx + qy * gy + qz * gz + w * gw;
  const Pack sign = choose(kept | (dot >= 0.0), all(1.0), all(-1.0));
  const Pack factor = sign / squareRoot(choose(kept, projected2, norm2));
  const Mask solved = verified | kept;
  putWhere(solved, choose(kept, px, qx) * factor, b.q[0] + i);
  putWhere(solved, choose(kept, py, qy) * factor, b.q[1] + i);
  putWhere(solved, choose(kept, pz, qz) * factor, b.q[2] + i);
  putWhere(solved, choose(kept, pw, w) * factor, b.q[3] + i);
  putWhere(solved, all(kSolved), b.state + i);
  putWhere(kept, all(0.0), b.unique + i);
}

// The profile matrix and the product of the rotations that make it diagonal.
struct Profile {
  Pack m[4][4];  // the upper triangle alone
  Pack v[4][4];  // v[k] is the k-th eigenvector, w x y z
};

MESHLESS_INLINE void turn(Pack c, Pack s, Pack& p, Pack& q) {
  const Pack old = p;
  p = c * old - s * q;
  q = s * old + c * q;
}

// Turns the plane of axes P and Q so that entry (P, Q) vanishes. I and J are the other two axes. Says which lanes it
// turned.
template <int P, int Q, int I, int J>
MESHLESS_INLINE Mask jacobiRotation(Profile& f) {
  const Pack off = f.m[P][Q], difference = f.m[Q][Q] - f.m[P][P];
  // A converged lane is turned by exactly nothing, however often its neighbours go on.
  const Mask active = absolute(off) > 1e-17;
  const Pack root = squareRoot(difference * difference + 4.0 * off * off);
  const Pack tangent = choose(difference < 0.0, all(-2.0), all(2.0)) * off / (absolute(difference) + root);
  const Pack t = choose(active, tangent, all(0.0));
  const Pack c = 1.0 / squareRoot(1.0 + t * t), s = t * c;
  f.m[P][P] -= t * off;
  f.m[Q][Q] += t * off;
  f.m[P][Q] = choose(active, all(0.0), off);
  turn(c, s, f.m[P < I ? P : I][P < I ? I : P], f.m[Q < I ? Q : I][Q < I ? I : Q]);
  turn(c, s, f.m[P < J ? P : J][P < J ? J : P], f.m[Q < J ? Q : J][Q < J ? J : Q]);
  for (int k = 0; k < 4; ++k) turn(c, s, f.v[P][k], f.v[Q][k]);
  return active;
}

template <class Scalar>
void jacobiLanes(Block& b, int i) {
  const Matrix a = matrixAt(b, i);
  Profile f;
  f.m[0][0] = a.a00 + a.a11 + a.a22, f.m[1][1] = a.a00 - a.a11 - a.a22;
  f.m[2][2] = a.a11 - a.a00 - a.a22, f.m[3][3] = a.a22 - a.a00 - a.a11;
  f.m[0][1] = a.a21 - a.a12, f.m[0][2] = a.a02 - a.a20, f.m[0][3] = a.a10 - a.a01;
  f.m[1][2] = a.a01 + a.a10, f.m[1][3] = a.a02 + a.a20, f.m[2][3] = a.a12 + a.a21;
  for (int k = 0; k < 4; ++k)
    for (int c = 0; c < 4; ++c) f.v[k][c] = all(k == c ? 1.0 : 0.0);
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    Mask turned = jacobiRotation<0, 1, 2, 3>(f);
    turned |= jacobiRotation<2, 3, 0, 1>(f);
    turned |= jacobiRotation<0, 2, 1, 3>(f);
    turned |= jacobiRotation<1, 3, 0, 2>(f);
    turned |= jacobiRotation<0, 3, 1, 2>(f);
    turned |= jacobiRotation<1, 2, 0, 3>(f);
    if (!any(turned)) break;
  }
  Pack n2 = all(0.0);
  for (int k = 0; k < 9; ++k) n2 += get(b.a[k] + i) * get(b.a[k] + i);
  const Pack gap = kRotationUniqueGap<Scalar> * squareRoot(n2);
  const Pack largest = larger(larger(f.m[0][0], f.m[1][1]), larger(f.m[2][2], f.m[3][3]));
  const Pack g[4] = {get(b.q[3] + i), get(b.q[0] + i), get(b.q[1] + i), get(b.q[2] + i)};
  // Every unit quaternion of the largest eigenvalue's space is as near; take the one closest to the guess.
  Pack dimensions = all(0.0), q[4] = {}, top[4] = {};
  for (int k = 0; k < 4; ++k) {
    const Mask in = largest - f.m[k][k] <= gap;
    const Pack dot = f.v[k][0] * g[0] + f.v[k][1] * g[1] + f.v[k][2] * g[2] + f.v[k][3] * g[3];
    dimensions += choose(in, all(1.0), all(0.0));
    for (int c = 0; c < 4; ++c) q[c] += choose(in, dot, all(0.0)) * f.v[k][c];
    for (int c = 0; c < 4; ++c) top[c] = choose(f.m[k][k] == largest, f.v[k][c], top[c]);
  }
  // A guess at right angles to that space says nothing.
  const Mask useful = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] > 1e-24;
  for (int c = 0; c < 4; ++c) q[c] = choose(useful, q[c], top[c]);
  const Pack factor = 1.0 / squareRoot(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const Mask pending = get(b.state + i) == kPending;
  for (int c = 0; c < 4; ++c) putWhere(pending, q[c] * factor, b.q[(c + 3) % 4] + i);
  putWhere(pending, choose(dimensions == 1.0, all(1.0), all(0.0)), b.unique + i);
  putWhere(pending, all(kSolved), b.state + i);
}

// Moves the pending items of a block to the front of another, solves them there and takes them back.
template <class Scalar, class Method>
MESHLESS_INLINE void solvePending(Block& b, int count, Method method) {
  Mask left = {};
  for (int i = 0; i < count; i += kLanes) left |= get(b.state + i) == kPending;
  if (!any(left)) return;
  int index[kBlock];
  int pending = 0;
  for (int i = 0; i < count; ++i) {
    index[pending] = i;
    pending += b.state[i] == kPending ? 1 : 0;
  }
  if (pending == 0) return;  // only padding was left
  Block packed;
  const int end = padded(pending);
  for (int i = 0; i < end; ++i) {
    const int from = index[i < pending ? i : 0];
    for (int k = 0; k < 9; ++k) packed.a[k][i] = b.a[k][from];
    for (int k = 0; k < 4; ++k) packed.q[k][i] = b.q[k][from];
    packed.state[i] = kPending;
    packed.unique[i] = 1.0;
  }
  method(packed, pending);
  for (int i = 0; i < pending; ++i) {
    for (int k = 0; k < 4; ++k) b.q[k][index[i]] = packed.q[k][i];
    b.state[index[i]] = packed.state[i];
    b.unique[index[i]] = packed.unique[i];
  }
}

template <class Scalar>
struct JacobiMethod {
  MESHLESS_INLINE void operator()(Block& b, int count) const {
    for (int begin = 0; begin < count; begin += kLanes) jacobiLanes<Scalar>(b, begin);
  }
};

template <class Scalar>
struct ColdMethod {
  MESHLESS_INLINE void operator()(Block& b, int count) const {
    Quartic quartic;
    for (int begin = 0; begin < count; begin += kLanes) coefficients(b, quartic, begin);
    for (int begin = 0; begin < count; begin += kLanes) largestRoot(quartic, begin);
    for (int begin = 0; begin < count; begin += kLanes) eigenvector<Scalar>(b, quartic, begin);
    solvePending<Scalar>(b, count, JacobiMethod<Scalar>());
  }
};

template <class Scalar>
MESHLESS_INLINE void load(const Scalar* from, std::size_t stride, std::size_t first, int count, int components,
                          double (*to)[kBlock]) {
  for (int k = 0; k < components; ++k) {
    const Scalar* source = from + k * stride + first;
    if (count == kBlock) {
      for (int i = 0; i < kBlock; ++i) to[k][i] = source[i];
    } else {
      for (int i = 0; i < count; ++i) to[k][i] = source[i];
      for (int i = count; i < padded(count); ++i) to[k][i] = 0.0;
    }
  }
}

template <class Scalar>
MESHLESS_INLINE void store(const double (*from)[kBlock], int components, Scalar* to, std::size_t stride,
                           std::size_t first, int count) {
  for (int k = 0; k < components; ++k) {
    Scalar* target = to + k * stride + first;
    for (int i = 0; i < count; ++i) target[i] = static_cast<Scalar>(from[k][i]);
  }
}

// The rotations as matrices, in place of those that they were found for.
void toMatrices(Block& b, int i) {
  const Pack x = get(b.q[0] + i), y = get(b.q[1] + i), z = get(b.q[2] + i), w = get(b.q[3] + i);
  const Pack s = 2.0 / (x * x + y * y + z * z + w * w);
  put(1.0 - s * (y * y + z * z), b.a[0] + i);
  put(s * (x * y - w * z), b.a[1] + i);
  put(s * (x * z + w * y), b.a[2] + i);
  put(s * (x * y + w * z), b.a[3] + i);
  put(1.0 - s * (x * x + z * z), b.a[4] + i);
  put(s * (y * z - w * x), b.a[5] + i);
  put(s * (x * z - w * y), b.a[6] + i);
  put(s * (y * z + w * x), b.a[7] + i);
  put(1.0 - s * (x * x + y * y), b.a[8] + i);
}

template <class Scalar>
void solveBatch(const RotationBatch<Scalar>& batch, bool warm) {
  Block b;
  for (std::size_t first = 0; first < batch.count; first += kBlock) {
    const int count = batch.count - first < kBlock ? static_cast<int>(batch.count - first) : kBlock;
    load(batch.matrices, batch.matrix_stride, first, count, 9, b.a);
    for (int begin = 0; begin < padded(count); begin += kLanes) normalise<Scalar>(b, begin);
    if (warm) {
      load(batch.quaternions, batch.quaternion_stride, first, count, 4, b.q);
      for (int begin = 0; begin < padded(count); begin += kLanes) cleanGuess(b, begin);
      for (int begin = 0; begin < count; begin += kNarrowLanes) narrowStep(b, begin);
      for (int begin = 0; begin < count; begin += kLanes) warmLanes<Scalar>(b, begin);
      for (int i = 0; i < count; i += kLanes) put(choose(get(b.state + i) == kSolved, all(1.0), all(0.0)), b.warm + i);
      solvePending<Scalar>(b, count, ColdMethod<Scalar>());
    } else {
      for (int k = 0; k < 4; ++k)
        for (int i = 0; i < kBlock; ++i) b.q[k][i] = k == 3 ? 1.0 : 0.0;
      for (int i = 0; i < kBlock; ++i) b.warm[i] = 0.0;
      ColdMethod<Scalar>()(b, count);
    }
    store(b.q, 4, batch.quaternions, batch.quaternion_stride, first, count);
    if (batch.rotations) {
      for (int begin = 0; begin < count; begin += kLanes) toMatrices(b, begin);
      store(b.a, 9, batch.rotations, batch.rotation_stride, first, count);
    }
    if (batch.flags) {
      std::uint8_t* const to = batch.flags + first;
      for (int i = 0; i < count; ++i)
        to[i] = static_cast<std::uint8_t>(static_cast<int>(kRotationUnique * b.unique[i] + kRotationWarm * b.warm[i]));
    }
  }
}

}  // namespace

void solve(const RotationBatch<float>& batch, bool warm) { solveBatch(batch, warm); }
void solve(const RotationBatch<double>& batch, bool warm) { solveBatch(batch, warm); }

}  // namespace meshless::rotation_sets::MESHLESS_SET
