// Elastic forces of a block of small clusters, compiled once for each instruction set: the including file sets the
// target, MESHLESS_SET and the width of a vector. A lane is a cluster; no lane sees its neighbours. In double: the
// forces of a cluster then cancel to 1e-16, and in float it is no faster than what feeds it.
#ifndef MESHLESS_SET
#error "set MESHLESS_SET, MESHLESS_SET_ENUM and MESHLESS_BYTES before including elastic_batch_kernel.h"
#endif

#include "double_pack.h"
#include "elastic_constants.h"

namespace meshless::elastic_sets::MESHLESS_SET {
namespace {

using namespace elastic_law;

constexpr int kMostSteps = 4;     // of Newton's method; from one substep to the next two do
constexpr double kStep6 = 1e-25;  // length^6 of the last step, times the condition number squared: 3e-13 rad are left
constexpr double kConditioned = 1e-4;  // smallest eigenvalue of the Hessian over its trace
constexpr double kLongestStep2 = 1.0;  // [rad^2] beyond it the quadratic model says nothing

struct Matrix {
  Pack m[3][3];
};

constexpr int kModes[4] = {3, 5, 6, 7};  // by the bits of their coordinates

// Between the two passes over a block.
struct alignas(64) Fits {
  double gradient[9][kBlock];  // F, row by row
  double strained[9][kBlock];  // likewise, from the shape without stress where that is another
  double centre[3][kBlock];    // less the first corner
  double pending[kBlock];      // 1: no rotation was found yet
};

MESHLESS_INLINE void putMatrix(const Matrix& a, double (*to)[kBlock], int i) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) put(a.m[r][c], to[3 * r + c] + i);
}
MESHLESS_INLINE Matrix matrixAt(const double (*from)[kBlock], int i) {
  Matrix a;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) a.m[r][c] = get(from[3 * r + c] + i);
  return a;
}

MESHLESS_INLINE Matrix rotationMatrix(Pack x, Pack y, Pack z, Pack w, Pack s) {  // s = 2 / |q|^2
  Matrix r;
  const Pack sx = s * x, sy = s * y, sz = s * z;
  const Pack xx = sx * x, yy = sy * y, zz = sz * z, xy = sx * y, xz = sx * z, yz = sy * z;
  const Pack wx = sx * w, wy = sy * w, wz = sz * w;
  r.m[0][0] = 1.0 - (yy + zz), r.m[0][1] = xy - wz, r.m[0][2] = xz + wy;
  r.m[1][0] = xy + wz, r.m[1][1] = 1.0 - (xx + zz), r.m[1][2] = yz - wx;
  r.m[2][0] = xz - wy, r.m[2][1] = yz + wx, r.m[2][2] = 1.0 - (xx + yy);
  return r;
}

// Positions relative to the cluster's first corner, into the rows of `forces`.
void gather(const Block& b) {
  const int end = (b.count + kLanes - 1) / kLanes * kLanes;
#if MESHLESS_BYTES >= 32
  // Four particles at a time, transposed: instructions that gather are slower.
  const __m256i three = _mm256_setr_epi64x(-1, -1, -1, 0);
  for (int i = 0; i < end; i += 4) {
    __m256d origin[4];
    for (int k = 0; k < kCorners; ++k) {
      __m256d p[4];
      for (int l = 0; l < 4; ++l) {
        p[l] = _mm256_maskload_pd(b.positions + 3 * static_cast<std::size_t>(b.particles[k * kBlock + i + l]), three);
        if (k == 0) origin[l] = p[l];
        p[l] -= origin[l];
      }
      const __m256d xz01 = _mm256_unpacklo_pd(p[0], p[1]), y01 = _mm256_unpackhi_pd(p[0], p[1]);
      const __m256d xz23 = _mm256_unpacklo_pd(p[2], p[3]), y23 = _mm256_unpackhi_pd(p[2], p[3]);
      double* const to = b.forces + 3 * k * kBlock + i;
      _mm256_storeu_pd(to, _mm256_permute2f128_pd(xz01, xz23, 0x20));
      _mm256_storeu_pd(to + kBlock, _mm256_permute2f128_pd(y01, y23, 0x20));
      _mm256_storeu_pd(to + 2 * kBlock, _mm256_permute2f128_pd(xz01, xz23, 0x31));
    }
  }
#else
  for (int i = 0; i < end; ++i) {
    const double* const origin = b.positions + 3 * static_cast<std::size_t>(b.particles[i]);
    const double ox = origin[0], oy = origin[1], oz = origin[2];
    for (int k = 0; k < kCorners; ++k) {
      const double* const p = b.positions + 3 * static_cast<std::size_t>(b.particles[k * kBlock + i]);
      double* const to = b.forces + 3 * k * kBlock + i;
      to[0] = p[0] - ox;
      to[kBlock] = p[1] - oy;
      to[2 * kBlock] = p[2] - oz;
    }
  }
#endif
}

// F of a cell: axis by axis its corners become their mean at the centroid and half their difference. The coefficients
// of the products of two and three coordinates, over half an edge, replace the positions of the corners 3, 5, 6, 7.
template <bool kWhole>
MESHLESS_INLINE Matrix fitCell(const Block& b, int i) {
  const Pack scale = all(0.125 / b.half_edge);
  Matrix f;
  for (int axis = 0; axis < 3; ++axis) {
    double* const p = b.forces + axis * kBlock + i;
    Pack a[kCorners];
    for (int k = 0; k < kCorners; ++k) a[k] = get(p + 3 * k * kBlock);
    for (int d = 0; d < 3; ++d) {
      const Pack at = kWhole ? Pack{} : get(b.cells + i + (kCentroidRow + d) * kBlock);
      for (int k = 0; k < kCorners; ++k) {
        if (k >> d & 1) continue;
        const Pack low = a[k], high = a[k | 1 << d], difference = high - low;
        a[k] = kWhole ? low + high : low + high + at * difference;
        a[k | 1 << d] = difference;
      }
    }
    f.m[axis][0] = scale * a[1], f.m[axis][1] = scale * a[2], f.m[axis][2] = scale * a[4];
    for (const int mode : kModes) put(scale * a[mode], p + 3 * mode * kBlock);
  }
  return f;
}

// Times a symmetric matrix: rows xx xy xz yy yz zz.
MESHLESS_INLINE Matrix timesSymmetric(const Matrix& a, const double* s) {
  const Pack xx = get(s), xy = get(s + kBlock), xz = get(s + 2 * kBlock), yy = get(s + 3 * kBlock);
  const Pack yz = get(s + 4 * kBlock), zz = get(s + 5 * kBlock);
  Matrix f;
  for (int r = 0; r < 3; ++r) {
    f.m[r][0] = a.m[r][0] * xx + a.m[r][1] * xy + a.m[r][2] * xz;
    f.m[r][1] = a.m[r][0] * xy + a.m[r][1] * yy + a.m[r][2] * yz;
    f.m[r][2] = a.m[r][0] * xz + a.m[r][1] * yz + a.m[r][2] * zz;
  }
  return f;
}

MESHLESS_INLINE Matrix fitAny(const Block& b, Fits& fits, int i) {
  const double* const shape = b.shape + i;
  Matrix a = {};
  Pack centre[3] = {};
  for (int k = 0; k < kCorners; ++k) {
    const Pack share = get(shape + (kShareRow + k) * kBlock);
    const double* const q = shape + (kRestRow + 3 * k) * kBlock;
    const Pack q0 = get(q), q1 = get(q + kBlock), q2 = get(q + 2 * kBlock);
    for (int axis = 0; axis < 3; ++axis) {
      const Pack p = share * get(b.forces + (3 * k + axis) * kBlock + i);
      centre[axis] += p;
      a.m[axis][0] += p * q0;
      a.m[axis][1] += p * q1;
      a.m[axis][2] += p * q2;
    }
  }
  for (int axis = 0; axis < 3; ++axis) put(centre[axis], fits.centre[axis] + i);
  return timesSymmetric(a, shape + kInverseRow * kBlock);
}

// Newton's method on the rotation vector from the last rotation (Kugelstadt et al. 2018), until it verifies itself: a
// stationary point with a positive definite Hessian is the maximum of tr(R^T F). The third derivative is zero there, so
// that what a step leaves is of its third order. A lane that is done changes no more.
MESHLESS_INLINE void rotate(const Block& b, const Matrix& f, Fits& fits, int i) {
  double* const q = b.rotations + i;
  Pack x = get(q), y = get(q + kBlock), z = get(q + 2 * kBlock), w = get(q + 3 * kBlock);
  Pack s = all(2.0);
  Mask done = {}, pending = ~done;
  for (int step = 0; step < kMostSteps; ++step) {
    const Matrix r = rotationMatrix(x, y, z, w, s);
    Matrix a;
    for (int row = 0; row < 3; ++row)
      for (int c = 0; c < 3; ++c)
        a.m[row][c] = r.m[0][row] * f.m[0][c] + r.m[1][row] * f.m[1][c] + r.m[2][row] * f.m[2][c];
    const Pack g0 = a.m[2][1] - a.m[1][2], g1 = a.m[0][2] - a.m[2][0], g2 = a.m[1][0] - a.m[0][1];
    const Pack h00 = a.m[1][1] + a.m[2][2], h11 = a.m[0][0] + a.m[2][2], h22 = a.m[0][0] + a.m[1][1];
    const Pack h01 = -0.5 * (a.m[0][1] + a.m[1][0]), h02 = -0.5 * (a.m[0][2] + a.m[2][0]);
    const Pack h12 = -0.5 * (a.m[1][2] + a.m[2][1]);
    const Pack c00 = h11 * h22 - h12 * h12, c01 = h02 * h12 - h01 * h22, c02 = h01 * h12 - h02 * h11;
    const Pack c11 = h00 * h22 - h02 * h02, c12 = h01 * h02 - h00 * h12, c22 = h00 * h11 - h01 * h01;
    const Pack determinant = h00 * c00 + h01 * c01 + h02 * c02;
    const Pack half = 0.5 / determinant;
    const Pack v0 = half * (c00 * g0 + c01 * g1 + c02 * g2);
    const Pack v1 = half * (c01 * g0 + c11 * g1 + c12 * g2);
    const Pack v2 = half * (c02 * g0 + c12 * g1 + c22 * g2);
    const Pack quarter2 = v0 * v0 + v1 * v1 + v2 * v2;
    const Pack length2 = 4.0 * quarter2;
    // The two larger eigenvalues have a product of at most (trace/2)^2: 4 det / trace^2 bounds the smallest from below.
    const Pack trace = h00 + h11 + h22;
    const Pack trace3 = trace * trace * trace;
    const Mask sound =
        (h00 > 0.0) & (c22 > 0.0) & (4.0 * determinant > kConditioned * trace3) & (length2 < kLongestStep2) & pending;
    const Pack nx = x + w * v0 + y * v2 - z * v1, ny = y + w * v1 + z * v0 - x * v2;
    const Pack nz = z + w * v2 + x * v1 - y * v0, nw = w - x * v0 - y * v1 - z * v2;
    x = choose(sound, nx, x), y = choose(sound, ny, y), z = choose(sound, nz, z), w = choose(sound, nw, w);
    const Mask close =
        sound & (length2 * length2 * length2 * (trace3 * trace3) <= 16.0 * kStep6 * (determinant * determinant));
    done |= close;
    pending = sound & ~close;
    if (!any(pending)) break;
    s = 2.0 / (x * x + y * y + z * z + w * w);
  }
  const Pack factor = 1.0 / squareRoot(x * x + y * y + z * z + w * w);
  put(choose(done, x * factor, get(q)), q);
  put(choose(done, y * factor, get(q + kBlock)), q + kBlock);
  put(choose(done, z * factor, get(q + 2 * kBlock)), q + 2 * kBlock);
  put(choose(done, w * factor, get(q + 3 * kBlock)), q + 3 * kBlock);
  put(choose(done, all(0.0), all(1.0)), fits.pending + i);
}

// What Newton's method did not find.
std::size_t rotateCold(const Block& b, const Fits& fits) {
  int index[kBlock];
  int count = 0;
  for (int i = 0; i < b.count; ++i) {
    index[count] = i;
    count += fits.pending[i] == 1.0 ? 1 : 0;
  }
  if (count == 0) return 0;
  double matrices[9][kBlock], quaternions[4][kBlock];
  const auto& turned = b.unstressed ? fits.strained : fits.gradient;
  for (int n = 0; n < count; ++n) {
    for (int k = 0; k < 9; ++k) matrices[k][n] = turned[k][index[n]];
    for (int k = 0; k < 4; ++k) quaternions[k][n] = b.rotations[k * kBlock + index[n]];
  }
  RotationBatch<double> batch;
  batch.count = static_cast<std::size_t>(count);
  batch.matrices = matrices[0];
  batch.quaternions = quaternions[0];
  batch.matrix_stride = batch.quaternion_stride = kBlock;
  nearestRotationsWarm(batch, InstructionSet::MESHLESS_SET_ENUM);
  for (int n = 0; n < count; ++n)
    for (int k = 0; k < 4; ++k) b.rotations[k * kBlock + index[n]] = quaternions[k][n];
  return static_cast<std::size_t>(count);
}

// volumeStrain() of elastic_law.h.
MESHLESS_INLINE Pack volumeStrain(Pack j) {
  Pack strain = (j > kLeastVolume ? j : all(kLeastVolume)) - 1.0;
  const Mask torn = j > kMostVolume;
  if (any(torn))
    for (int l = 0; l < kLanes; ++l)
      if (torn[l]) {
        const double root = __builtin_cbrt(kMostVolume / j[l]);
        strain[l] = (kMostVolume - 1.0) * root * root;
      }
  return strain;
}

// heldVolume() of elastic_law.h: of what is drawn out far; j and its slope by F are those of the whole volume before.
MESHLESS_INLINE void holdLess(const Matrix& f, Pack norm2, Pack& j, Matrix& slope, Pack& share) {
  const Pack beyond = norm2 * (1.0 / kDrawnOut) - 1.0;
  const Mask drawn = beyond > 0.0;
  if (!any(drawn)) return;
  const Pack base = 1.0 + beyond * beyond;
  const Pack root = squareRoot(base);
  share = choose(drawn, 1.0 / (root * squareRoot(root)), all(1.0));
  const Pack turn = choose(drawn, (3.0 / kDrawnOut) * beyond / base * j, all(0.0));
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c) slope.m[row][c] = share * (slope.m[row][c] - turn * f.m[row][c]);
  j *= share;
}

// Lame's constants over density, and what they give.
struct Lame {
  Pack shear, pressure;  // 2 mu, lambda
  Pack coupling;         // lambda / (lambda + 2 mu)
};
MESHLESS_INLINE Lame lameOf(const Block& b, int i) {
  if (!b.mixes) return {all(b.shear), all(b.pressure), all(b.pressure / (b.pressure + b.shear))};
  const double* const mix = b.mixes + i;
  const Pack own = get(mix + kOwnRow * kBlock);
  const Pack shear = own * b.shear + b.youngs * get(mix + kShearRow * kBlock);
  const Pack pressure = own * b.pressure + b.youngs * get(mix + kPressureRow * kBlock);
  return {shear, pressure, pressure / (pressure + shear)};
}

// Of a lane, as ElasticParameters has them.
struct Growth {
  Pack stiffening, asymmetry;
};
MESHLESS_INLINE Growth growthOf(const Block& b, int i) {
  if (!b.mixes) return {all(b.stiffening), all(b.asymmetry)};
  const double* const mix = b.mixes + i;
  const Pack own = get(mix + kOwnRow * kBlock);
  return {own * b.stiffening + get(mix + kStiffeningRow * kBlock),
          own * b.asymmetry + get(mix + kAsymmetryRow * kBlock)};
}

// distortion() of elastic_law.h: half its slope, and its curvature.
MESHLESS_INLINE Matrix distort(const Matrix& f, const Matrix& r, const Growth& growth, Pack& curvature) {
  Matrix d;
  Pack trace = {};
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c) {
      d.m[row][c] = f.m[row][c] - r.m[row][c];
      trace += r.m[row][c] * d.m[row][c];
    }
  const Pack third = (1.0 / 3.0) * trace;
  Pack m = {};
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c) {
      d.m[row][c] -= third * r.m[row][c];
      m += d.m[row][c] * d.m[row][c];
    }
  Matrix strain, square;
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c)
      strain.m[row][c] = r.m[0][row] * d.m[0][c] + r.m[1][row] * d.m[1][c] + r.m[2][row] * d.m[2][c];
  Pack cubed = {};
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c) {
      square.m[row][c] = d.m[row][0] * strain.m[0][c] + d.m[row][1] * strain.m[1][c] + d.m[row][2] * strain.m[2][c];
      cubed += square.m[row][c] * d.m[row][c];
    }
  const Pack a = growth.asymmetry, x = a * a * m;
  const Pack level = 1.0 / (1.0 + (1.0 / kLevel) * x), u = squareRoot(level), fourth = kFourth * (x * level);
  const Pack q = m + trace * third - a * cubed * u + fourth * m;
  const Pack by_m = 1.0 + (0.5 / kLevel) * (a * a * a) * (cubed * u * level) + fourth * (1.0 + level), by_c = -a * u;
  const Pack grown = 1.0 / (1.0 + (1.0 / (kMostStiffening - 1.0)) * (growth.stiffening * q));
  const Pack steep = 1.0 + growth.stiffening * (q * grown);
  const Pack turned = third - 0.5 * (by_c * m), squares = 1.5 * by_c;
  Matrix half;
  Pack norm2 = {};
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c) {
      const Pack by_f = turned * r.m[row][c] + by_m * d.m[row][c] + squares * square.m[row][c];
      norm2 += by_f * by_f;
      half.m[row][c] = steep * by_f;
    }
  curvature =
      steep * (2.0 + (kCurved - 2.0) * x / (kCurvedFrom + x)) + 4.0 * (growth.stiffening * (grown * grown)) * norm2;
  return half;
}

// deviatorOf(), takeOn() and takenOn() of elastic_law.h, over mu.
MESHLESS_INLINE Matrix relax(const Block& b, const Matrix& f, const Matrix& r, int i) {
  Matrix s;
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c)
      s.m[row][c] = r.m[0][row] * f.m[0][c] + r.m[1][row] * f.m[1][c] + r.m[2][row] * f.m[2][c];
  const Pack trace = s.m[0][0] + s.m[1][1] + s.m[2][2], mean = (1.0 / 3.0) * trace;
  const Pack xy = 0.5 * (s.m[0][1] + s.m[1][0]), yz = 0.5 * (s.m[1][2] + s.m[2][1]), zx = 0.5 * (s.m[2][0] + s.m[0][2]);
  const Pack d[kStrainRows] = {s.m[0][0] - mean, s.m[1][1] - mean, s.m[2][2] - mean, xy, yz, zx};
  const Pack size2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + 2.0 * (xy * xy + yz * yz + zx * zx);
  const Pack share = choose(size2 > 1.0, 1.0 / squareRoot(size2), all(1.0));
  Pack sum[kStrainRows] = {};
  for (int k = 0; k < b.branches; ++k)
    for (int c = 0; c < kStrainRows; ++c) {
      double* const at = b.relaxed + (k * kStrainRows + c) * kBlock + i;
      const Pack before = get(at), taken = before + b.taken[k] * (share * d[c] - before);
      sum[c] += b.shares[k] * taken;
      put(taken, at);
    }
  Matrix a;
  constexpr int kAt[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c) a.m[row][c] = sum[kAt[row][c]];
  const auto turning = [&](int row, int c) __attribute__((always_inline)) {
    return s.m[row][0] * a.m[0][c] + s.m[row][1] * a.m[1][c] + s.m[row][2] * a.m[2][c];
  };
  const Pack ax = turning(2, 1) - turning(1, 2), ay = turning(0, 2) - turning(2, 0), az = turning(1, 0) - turning(0, 1);
  const Pack k00 = trace - s.m[0][0], k11 = trace - s.m[1][1], k22 = trace - s.m[2][2];
  const Pack c00 = k11 * k22 - yz * yz, c01 = zx * yz + xy * k22, c02 = xy * yz + zx * k11;
  const Pack c11 = k00 * k22 - zx * zx, c12 = xy * zx + yz * k00, c22 = k00 * k11 - xy * xy;
  const Pack determinant = k00 * c00 - xy * c01 - zx * c02, both = 2.0 * trace;
  const Pack inverse = choose(determinant > kTurns * (both * both * both), 1.0 / determinant, Pack{});
  const Pack ux = inverse * (c00 * ax + c01 * ay + c02 * az), uy = inverse * (c01 * ax + c11 * ay + c12 * az);
  const Pack uz = inverse * (c02 * ax + c12 * ay + c22 * az);
  a.m[0][1] -= uz, a.m[0][2] += uy, a.m[1][2] -= ux;
  a.m[1][0] += uz, a.m[2][0] -= uy, a.m[2][1] += ux;
  Matrix by_f;
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c)
      by_f.m[row][c] = r.m[row][0] * a.m[0][c] + r.m[row][1] * a.m[1][c] + r.m[row][2] * a.m[2][c];
  return by_f;
}

// pullFibres() of elastic_law.h over density.
MESHLESS_INLINE void pullFibres(const Block& b, const Matrix& f, int i, Matrix& p, Pack& steepness) {
  const Pack a[3] = {get(b.fibres + i), get(b.fibres + kBlock + i), get(b.fibres + 2 * kBlock + i)};
  Pack drawn[3], length2 = {};
  for (int row = 0; row < 3; ++row) {
    drawn[row] = f.m[row][0] * a[0] + f.m[row][1] * a[1] + f.m[row][2] * a[2];
    length2 += drawn[row] * drawn[row];
  }
  const Pack length = squareRoot(length2), longer = length - 1.0;
  const Mask pulls = longer > 0.0;
  const Pack q = longer * longer, grown = 1.0 / (1.0 + (b.fibre_stiffening / (kMostStiffening - 1.0)) * q);
  const Pack slope = 1.0 + b.fibre_stiffening * (q * grown);
  const Pack stiffness = b.mixes ? b.fibre * get(b.mixes + kOwnRow * kBlock + i) : all(b.fibre);
  const Pack pull = choose(pulls, stiffness * longer * slope / length, Pack{});
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c) p.m[row][c] += pull * drawn[row] * a[c];
  const Pack steep = 3.0 * (slope + 2.0 * b.fibre_stiffening * (q * (grown * grown)));
  steepness = choose(pulls & (steep > steepness), steep, steepness);
}

// Stress over density, and the steepness, as stress() of elastic_law.h.
template <bool kStiffens>
MESHLESS_INLINE Matrix stress(const Block& b, const Matrix& gradient, const Lame& lame, int i, Pack& steepness) {
  Matrix f;
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c) f.m[row][c] = b.shrink * gradient.m[row][c];
  const double* const q = b.rotations + i;
  const Matrix r = rotationMatrix(get(q), get(q + kBlock), get(q + 2 * kBlock), get(q + 3 * kBlock), all(2.0));
  Matrix slope;  // cof F
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c) {
      const int r1 = (row + 1) % 3, r2 = (row + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
      slope.m[row][c] = f.m[r1][c1] * f.m[r2][c2] - f.m[r1][c2] * f.m[r2][c1];
    }
  Pack j = f.m[0][0] * slope.m[0][0] + f.m[0][1] * slope.m[0][1] + f.m[0][2] * slope.m[0][2];
  Pack norm2 = {};
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c) norm2 += f.m[row][c] * f.m[row][c];
  Pack share = all(1.0);
  holdLess(f, norm2, j, slope, share);
  const Pack strain = volumeStrain(j);
  const Pack pressure = lame.pressure * strain;
  steepness = choose(strain < 0.0, -strain, strain) * (share * squareRoot(norm2));
  for (int row = 0; row < 3; ++row)
    for (int c = 0; c < 3; ++c) steepness += slope.m[row][c] * slope.m[row][c];
  Matrix p;
  if constexpr (kStiffens) {
    Pack curvature;
    p = distort(f, r, growthOf(b, i), curvature);
    const Pack grown =
        (lame.pressure * steepness + 0.5 * (lame.shear * curvature)) / (lame.pressure + (1.0 / 3.0) * lame.shear);
    steepness = grown > steepness ? grown : steepness;
    if (b.branches > 0)
      for (int row = 0; row < 3; ++row)
        for (int c = 0; c < 3; ++c) p.m[row][c] = (1.0 - b.share) * p.m[row][c] + b.share * (f.m[row][c] - r.m[row][c]);
    for (int row = 0; row < 3; ++row)
      for (int c = 0; c < 3; ++c) p.m[row][c] = lame.shear * p.m[row][c] + pressure * slope.m[row][c];
  } else {
    for (int row = 0; row < 3; ++row)
      for (int c = 0; c < 3; ++c) p.m[row][c] = lame.shear * (f.m[row][c] - r.m[row][c]) + pressure * slope.m[row][c];
  }
  if (b.branches > 0) {
    const Matrix taken = relax(b, f, r, i);
    for (int row = 0; row < 3; ++row)
      for (int c = 0; c < 3; ++c) p.m[row][c] -= lame.shear * taken.m[row][c];
  }
  if (b.fibres) pullFibres(b, f, i, p, steepness);
  return p;
}

// The forces [N] of a cluster on its corners, less their sign: m_ic (P S q + k (p - F q)). They replace the positions.
MESHLESS_INLINE void pushAny(const Block& b, const Fits& fits, const Matrix& f, const Matrix& p, int i) {
  const double* const shape = b.shape + i;
  const Pack mass = get(b.masses + i);
  const Pack k = b.hourglass * get(shape + kSoftnessRow * kBlock);
  Matrix pull = timesSymmetric(p, shape + kInverseRow * kBlock);
  Pack middle[3];
  for (int axis = 0; axis < 3; ++axis) {
    for (int c = 0; c < 3; ++c) pull.m[axis][c] -= k * f.m[axis][c];
    middle[axis] = k * get(fits.centre[axis] + i);
  }
  for (int corner = 0; corner < kCorners; ++corner) {
    const Pack share = mass * get(shape + (kShareRow + corner) * kBlock);
    const double* const q = shape + (kRestRow + 3 * corner) * kBlock;
    const Pack q0 = get(q), q1 = get(q + kBlock), q2 = get(q + 2 * kBlock);
    for (int axis = 0; axis < 3; ++axis) {
      double* const at = b.forces + (3 * corner + axis) * kBlock + i;
      const Pack* const m = pull.m[axis];
      put(share * (m[0] * q0 + m[1] * q1 + m[2] * q2 + (k * get(at) - middle[axis])), at);
    }
  }
}

// bending() of elastic_law.h over density: its slopes by the modes replace them, those by the gradient are added to p.
template <bool kWhole>
MESHLESS_INLINE void bend(const Block& b, const Matrix& f, const Lame& lame, Matrix& p, int i) {
  double* const modes = b.forces + i;
  const auto at = [&](int mode, int axis) __attribute__((always_inline)) { return modes + (3 * mode + axis) * kBlock; };
  Pack stiffness[3];
  for (int k = 0; k < 3; ++k)
    stiffness[k] = kWhole ? (1.0 / 3.0) * lame.shear : lame.shear * get(b.cells + i + (kVarianceRow + k) * kBlock);
  Pack common = stiffness[0];
  if (!kWhole) {
    common = common < stiffness[1] ? common : stiffness[1];
    common = common < stiffness[2] ? common : stiffness[2];
  }
  common *= 0.5;
  Pack products[3][3], columns = {}, fourth = {};
  for (int c = 0; c < 3; ++c) {
    for (int d = 0; d <= c; ++d) {
      const Pack product = f.m[0][c] * f.m[0][d] + f.m[1][c] * f.m[1][d] + f.m[2][c] * f.m[2][d];
      products[c][d] = products[d][c] = product;
      fourth += (c == d ? 1.0 : 2.0) * (product * product);
    }
    columns += products[c][c];
  }
  const Pack by_columns = choose(columns > 0.0, 1.0 / columns, Pack{}), longest = fourth * by_columns;
  Pack square = longest;
  constexpr int kWithout[3] = {6, 5, 3};  // the mode without axis n
  Pack m[3][3], along[3][3], slope[3][3];
  for (int n = 0; n < 3; ++n) {
    for (int axis = 0; axis < 3; ++axis) {
      m[n][axis] = get(at(kWithout[n], axis));
      square += kModeSquare * (m[n][axis] * m[n][axis]);
    }
    for (int c = 0; c < 3; ++c) along[n][c] = f.m[0][c] * m[n][0] + f.m[1][c] * m[n][1] + f.m[2][c] * m[n][2];
  }
  const Pack inverse = choose(square > 0.0, 1.0 / square, Pack{});
  Pack twist[3];
  for (int k = 0; k < 3; ++k) {
    const int i1 = (k + 1) % 3, i2 = (k + 2) % 3;  // mode i1 k is the one without i2
    const Pack both = lame.coupling * (along[i2][i1] + along[i1][i2]);
    twist[k] = 0.5 * stiffness[k] * (along[i1][i1] + along[i2][i2]);
    slope[i2][i1] = stiffness[k] * (along[i2][i1] + both);
    slope[i1][i2] = stiffness[k] * (along[i1][i2] + both);
  }
  Pack twice = {};
  for (int n = 0; n < 3; ++n) {
    slope[n][n] = twist[(n + 1) % 3] + twist[(n + 2) % 3];
    for (int c = 0; c < 3; ++c) {
      slope[n][c] -= common * along[n][c];
      twice += along[n][c] * slope[n][c];
      slope[n][c] *= inverse;  // of along and of slope, which are not scaled
    }
  }
  twice *= inverse * inverse;
  const Pack of_columns = twice * by_columns;
  for (int axis = 0; axis < 3; ++axis) {
    for (int c = 0; c < 3; ++c) {
      const Pack along_columns =
          f.m[axis][0] * products[0][c] + f.m[axis][1] * products[1][c] + f.m[axis][2] * products[2][c];
      p.m[axis][c] += m[0][axis] * slope[0][c] + m[1][axis] * slope[1][c] + m[2][axis] * slope[2][c] -
                      of_columns * (2.0 * along_columns - longest * f.m[axis][c]);
    }
    for (int n = 0; n < 3; ++n)
      put(f.m[axis][0] * slope[n][0] + f.m[axis][1] * slope[n][1] + f.m[axis][2] * slope[n][2] +
              (common - kModeSquare * twice) * m[n][axis],
          at(kWithout[n], axis));
  }
  for (int axis = 0; axis < 3; ++axis) put(2.0 * common * get(at(7, axis)), at(7, axis));
}

// The transpose of fitCell().
template <bool kWhole>
MESHLESS_INLINE void pushCell(const Block& b, const Matrix& p, int i) {
  const Pack pull = get(b.masses + i) * (0.125 / b.half_edge);
  for (int axis = 0; axis < 3; ++axis) {
    double* const to = b.forces + axis * kBlock + i;
    Pack a[kCorners];
    a[0] = Pack{};
    a[1] = pull * p.m[axis][0], a[2] = pull * p.m[axis][1], a[4] = pull * p.m[axis][2];
    for (const int mode : kModes) a[mode] = pull * get(to + 3 * mode * kBlock);
    for (int d = 0; d < 3; ++d) {
      const Pack at = kWhole ? Pack{} : get(b.cells + i + (kCentroidRow + d) * kBlock);
      for (int k = 0; k < kCorners; ++k) {
        if (k >> d & 1) continue;
        const Pack mean = a[k], apart = kWhole ? a[k | 1 << d] : at * mean + a[k | 1 << d];
        a[k] = mean - apart;
        a[k | 1 << d] = mean + apart;
      }
    }
    for (int k = 0; k < kCorners; ++k) put(a[k], to + 3 * k * kBlock);
  }
}

}  // namespace

namespace {

enum class Kind { kCluster, kWhole, kPartial };

template <Kind kKind, bool kStiffens>
MESHLESS_INLINE BlockResult accelerateOf(const Block& b) {
  BlockResult result;
  Fits fits;
  gather(b);
  for (int i = 0; i < b.count; i += kLanes) {
    Matrix f;
    if constexpr (kKind == Kind::kCluster)
      f = fitAny(b, fits, i);
    else
      f = fitCell<kKind == Kind::kWhole>(b, i);
    putMatrix(f, fits.gradient, i);
    if (b.unstressed) {
      f = timesSymmetric(f, b.unstressed + i);
      putMatrix(f, fits.strained, i);
    }
    rotate(b, f, fits, i);
  }
  result.cold = rotateCold(b, fits);
  Pack most = {};
  for (int i = 0; i < b.count; i += kLanes) {
    const Matrix f = matrixAt(fits.gradient, i);
    const Lame lame = lameOf(b, i);
    Pack steepness;
    Matrix p = stress<kStiffens>(b, b.unstressed ? matrixAt(fits.strained, i) : f, lame, i, steepness);
    if (b.unstressed) {
      p = timesSymmetric(p, b.unstressed + i);
      steepness *= get(b.unstressed + kSteeperRow * kBlock + i);
    }
    if (i + kLanes > b.count)  // what only fills up has no rotation of its own
      for (int l = b.count - i; l < kLanes; ++l) steepness[l] = 0.0;
    most = steepness > most ? steepness : most;
    if constexpr (kKind == Kind::kCluster) {
      pushAny(b, fits, f, p, i);
    } else {
      bend<kKind == Kind::kWhole>(b, f, lame, p, i);
      pushCell<kKind == Kind::kWhole>(b, p, i);
    }
  }
  for (int l = 0; l < kLanes; ++l)
    if (most[l] > result.most) result.most = most[l];
  return result;
}

template <bool kStiffens>
MESHLESS_INLINE BlockResult accelerateBy(const Block& b) {
  if (b.shape) return accelerateOf<Kind::kCluster, kStiffens>(b);
  return b.cells ? accelerateOf<Kind::kPartial, kStiffens>(b) : accelerateOf<Kind::kWhole, kStiffens>(b);
}

}  // namespace

BlockResult accelerate(const Block& b) { return b.stiffens ? accelerateBy<true>(b) : accelerateBy<false>(b); }

}  // namespace meshless::elastic_sets::MESHLESS_SET
