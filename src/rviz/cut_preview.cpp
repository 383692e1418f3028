#include "cut_preview.h"

#include <algorithm>
#include <limits>

#include "ogre_convert.h"

namespace meshless {
namespace {

/// Keeps of from..to the shares [first, last] where low <= a + share * (b - a) <= high.
void clip(double a, double b, double low, double high, double& first, double& last) {
  if (a == b) {
    if (!(a >= low && a <= high)) last = -1.0;
    return;
  }
  const double at_low = (low - a) / (b - a), at_high = (high - a) / (b - a);
  first = std::max(first, std::min(at_low, at_high));
  last = std::min(last, std::max(at_low, at_high));
}

bool meetsRectangle(const PreviewLine& line, const PreviewBlades& blades) {
  constexpr double kEndless = std::numeric_limits<double>::max();
  const double length = blades.length > 0.0 ? blades.length : kEndless;
  const double half = blades.width > 0.0 ? 0.5 * blades.width : kEndless;
  const Ogre::Vector3 a = line.from - blades.pivot, b = line.to - blades.pivot;
  double first = 0.0, last = 1.0;
  clip(a.dotProduct(blades.reach), b.dotProduct(blades.reach), blades.length > 0.0 ? 0.0 : -kEndless, length, first,
       last);
  clip(a.dotProduct(blades.open), b.dotProduct(blades.open), -half, half, first, last);
  return first <= last;
}

}  // namespace

std::vector<PreviewLine> linesOfCut(const meshless_surgery::Surfaces& surfaces, const PreviewBlades& blades) {
  const Ogre::Vector3 normal = blades.reach.crossProduct(blades.open);
  std::vector<PreviewLine> lines;
  std::vector<float> heights;
  for (const auto& surface : surfaces.bodies) {
    const std::size_t begin = lines.size();
    const auto vertices = static_cast<std::uint32_t>(surface.vertices.size() / 3);
    heights.resize(vertices);
    for (std::uint32_t v = 0; v < vertices; ++v) heights[v] = (vertexOf(surface, v) - blades.pivot).dotProduct(normal);
    bool met = false;
    for (std::size_t t = 0; t + 2 < surface.triangles.size(); t += 3) {
      Ogre::Vector3 ends[2];
      int count = 0;
      for (int k = 0; k < 3 && count < 2; ++k) {
        const std::uint32_t i = surface.triangles[t + k], j = surface.triangles[t + (k + 1) % 3];
        if ((heights[i] < 0.0f) == (heights[j] < 0.0f)) continue;
        const Ogre::Vector3 a = vertexOf(surface, i);
        ends[count++] = a + (vertexOf(surface, j) - a) * (heights[i] / (heights[i] - heights[j]));
      }
      if (count < 2) continue;
      lines.push_back({ends[0], ends[1]});
      met = met || meetsRectangle(lines.back(), blades);
    }
    if (!met) lines.resize(begin);
  }
  return lines;
}

CutPreview::CutPreview(Ogre::SceneManager* scene_manager) : shown_(scene_manager) { shown_.setMaxPointsPerLine(2); }

void CutPreview::show(const std::vector<PreviewLine>& lines, float width, const Ogre::Vector3& origin,
                      const Ogre::Quaternion& turn) {
  shown_.clear();
  shown_.setLineWidth(width);
  if (lines.size() > capacity_) {
    capacity_ = 2 * lines.size();
    shown_.setNumLines(static_cast<std::uint32_t>(capacity_));
  }
  shown_.setPosition(origin);
  shown_.setOrientation(turn);
  const Ogre::ColourValue colour(0.2f, 0.9f, 1.0f, 1.0f);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (i > 0) shown_.newLine();
    shown_.addPoint(lines[i].from, colour);
    shown_.addPoint(lines[i].to, colour);
  }
}

}  // namespace meshless
