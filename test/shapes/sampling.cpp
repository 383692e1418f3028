#include "shapes/sampling.h"

#include <cmath>

#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

/// The lattice's points inside; stops (false) beyond max_points.
bool collect(const Box& box, const SolidQuery& query, double spacing, double clearance, std::size_t max_points,
             Points& points) {
  points.clear();
  const Vec3 centre = 0.5 * (box.min + box.max);
  // Half an interval and a little, so that rounding does not lose a layer that touches the bounds.
  std::array<long, 3> reach;
  for (int k = 0; k < 3; ++k)
    reach[k] = static_cast<long>(std::floor(0.5 * (box.max[k] - box.min[k]) / spacing + 1e-9));
  for (long k = -reach[2]; k <= reach[2]; ++k)
    for (long j = -reach[1]; j <= reach[1]; ++j) {
      // No surface is nearer than `known` to where it was measured: up to there, a line's points are all on its side.
      double known = 0.0;
      bool inside = false;
      for (long i = -reach[0]; i <= reach[0]; ++i, known -= spacing) {
        const Vec3 p = centre + spacing * Vec3(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
        const bool decided = inside ? known > clearance && known > 0.0 : known > 0.0;
        if (!decided) {
          inside = query.contains(p);
          known = query.distance(p);
        }
        if (!inside || known < clearance) continue;
        if (points.size() == max_points) return false;
        points.push_back(p);
      }
    }
  return true;
}

}  // namespace

LatticeSample sampleInterior(const TriangleMesh& mesh, const SolidQuery& query, double spacing, double clearance,
                             std::size_t max_points) {
  LatticeSample sample;
  const Box box = boundsOf(mesh.vertices);
  if (!(spacing > 0.0) || !std::isfinite(spacing) || !(clearance >= 0.0) || box.empty()) return sample;
  sample.spacing_used = spacing;
  if (max_points == 0) return sample;
  // A lattice that is finer than the volume allows by far is not tried: it could have any number of points.
  const double volume = std::abs(signedVolume(mesh));
  const double finest = std::cbrt(volume / (2.0 * static_cast<double>(max_points)));
  // Clearance can leave few points of a fine lattice, but then only the outermost layer is kept out.
  const double shell = surfaceArea(mesh) * clearance;
  if (volume > 2.0 * shell && sample.spacing_used < finest) sample.spacing_used = finest;
  while (!collect(box, query, sample.spacing_used, clearance, max_points, sample.points)) sample.spacing_used *= 1.05;
  return sample;
}

}  // namespace meshless
