// What contact knows of a body's rest shape: which triangle is nearest to a point in it, and which points of its
// surface are queried in other shapes. Made once for a model, and filled where something comes near.
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <mutex>

#include "meshless_surgery/geometry/triangle_mesh.h"

namespace meshless {

class EmptySpace;

/// How the vertices of a surface follow the particles of a body: views, to be kept alive by whoever passes them.
struct SurfaceRows {
  const std::vector<Index>* particle = nullptr;  // one a vertex; kNoIndex: it is embedded
  const std::vector<Index>* embedded = nullptr;  // embedded vertices, ascending
  const std::vector<Index>* offsets = nullptr;   // one each, into the two below; and one more, their end
  const std::vector<Index>* carriers = nullptr;
  const std::vector<double>* weights = nullptr;
};

/// A point of the surface that is queried in other shapes: a vertex, or a point on a long edge.
struct ContactSample {
  std::array<Index, 2> vertices{};  // the same twice for a vertex
  double share = 0.0;               // of the second
  Vec3 normal = Vec3::Zero();       // unit, outwards at rest
};

class ContactShape {
 public:
  /// `surface`: rest positions [m], closed for solids. spacing [m]: of the particles; embedded vertices are samples
  /// about so far apart, those that are particles all. Long sharp edges get samples at half the thickness below them.
  /// On all edges together these are at most 1,000, or four for each on a vertex.
  ContactShape(const TriangleMesh& surface, const SurfaceRows& rows, double spacing);
  ~ContactShape();
  ContactShape(const ContactShape&) = delete;
  ContactShape& operator=(const ContactShape&) = delete;

  struct Nearest {
    Index triangle = kNoIndex;
    std::array<double, 3> weights{};  // barycentric, of the nearest point
    double distance = 0.0;            // [m] signed: negative inside
    bool above = false;               // the point's projection falls into the triangle
  };
  /// Of a point in the rest frame, whoever has asked before. Signs are those of the nearest
  /// triangle; on ties (an edge, a vertex) of the one with the larger plane distance. False without triangles, or for
  /// NaN. `hint`: a triangle that may be near makes it faster, and changes nothing else. Thread-safe.
  bool nearest(const Vec3& rest, Nearest& found, Index hint = kNoIndex) const;
  /// The same for a point of another body that reaches into that one along `inward` (unit, in this rest frame): near an
  /// edge, a face that would push it away from its own body gives way to one that does not and is at most `slack` [m]
  /// farther. Cubes that lie exactly along each other are held by their tops, not by their sides. What is farther than
  /// `reach` [m] from all stays with the nearest.
  bool nearest(const Vec3& rest, const Vec3& inward, double slack, double reach, Nearest& found,
               Index hint = kNoIndex) const;

  /// True only for a point outside that is more than `by` [m] from the surface, and for nearly all of those that are
  /// farther by half an edge. Faster where the same place was asked about before. Thread-safe.
  bool isClear(const Vec3& rest, double by) const;
  /// True only for points outside, and for all that are a few edges from the surface. Thread-safe.
  bool isOutside(const Vec3& rest) const;

  /// [m] from a point to a triangle of the surface.
  double distanceTo(Index triangle, const Vec3& rest) const;

  /// The triangle across the edge that lies against a corner of a triangle; kNoIndex at a border. Made when first asked
  /// for; thread-safe.
  Index across(Index triangle, int corner) const;
  /// How the surface bends there at rest: flat within 5 degrees, gently within 45. As for across().
  enum class Bend : char { kBorder, kFlat, kGentle, kRidge, kValley };
  Bend bend(Index triangle, int corner) const;
  /// Makes what the two above need.
  void link() const;

  const TriangleMesh& surface() const { return surface_; }
  const std::vector<ContactSample>& samples() const { return samples_; }
  const Box& bounds() const { return bounds_; }
  /// [m] median of some inward rays: who moves farther in a step can pass through.
  double thickness() const { return thickness_; }
  double meanEdge() const { return mean_edge_; }  // [m] of the triangles
  /// The work of a query, relative to one in a usual mesh, about: with slivers, hundreds lie around each point.
  double crowding() const { return crowding_; }
  /// [m] least edge of the bounds. Margins and limits of contact are relative to it.
  double size() const { return size_; }
  const SurfaceRows& rows() const { return rows_; }
  /// Of an embedded vertex: its number in rows(); kNoIndex for a particle.
  Index embeddedOf(Index vertex) const { return embedded_of_.empty() ? kNoIndex : embedded_of_[vertex]; }
  bool hasEmbedded() const { return !embedded_of_.empty(); }

  std::size_t cellsFilled() const { return cells_filled_.load(std::memory_order_relaxed); }
  /// Bytes that it holds.
  std::size_t bytes() const;

  struct Facet;

 private:
  struct Cell;
  const Cell* fill(std::size_t index, const std::array<int, 3>& at) const;
  std::size_t cellAt(const Vec3& rest, std::array<int, 3>& at) const;
  bool isBeyondCells(const Vec3& rest) const;
  bool searchBins(const Vec3& rest, double within, Nearest& found) const;
  bool anyWithin(const Vec3& rest, double by) const;
  bool isMistaken(const Vec3& rest, const Nearest& found) const;
  const EmptySpace& space() const;
  Vec3 cellCentre(const std::array<int, 3>& at) const;
  float distanceOfCentre(std::size_t index, const std::array<int, 3>& at) const;
  template <class Visit>
  void visitNear(const Vec3& rest, double radius, const Visit& visit) const;
  Bend bendAt(Index triangle, int corner) const;
  void binTriangles();
  template <class Visit>
  void visitBins(const Box& box, const Visit& visit) const;
  double depthAlong(const Vec3& from, const Vec3& direction, double least, double longest) const;
  void chooseSamples(double spacing);
  void measureThickness();

  TriangleMesh surface_;
  std::vector<Facet> facets_;  // one a triangle
  SurfaceRows rows_;
  std::vector<Index> embedded_of_;
  std::vector<ContactSample> samples_;
  Box bounds_;
  double size_ = 0.0, thickness_ = 0.0, mean_edge_ = 0.0, crowding_ = 1.0;

  // triangles by bins of a grid
  Vec3 bin_origin_ = Vec3::Zero();
  double bin_edge_ = 1.0;
  std::array<int, 3> bins_{{1, 1, 1}};
  std::vector<Index> bin_offsets_, bin_triangles_;
  std::vector<std::array<float, 4>> bin_spheres_;  // about them: centre from bin_origin_ [m], radius [m]

  mutable std::once_flag spaced_;
  mutable std::unique_ptr<EmptySpace> space_;

  // cells with the triangles that can be nearest to a point in them
  Vec3 cell_origin_ = Vec3::Zero();
  double cell_edge_ = 1.0, cells_per_metre_ = 1.0;
  std::array<int, 3> cells_count_{{0, 0, 0}};
  // A cell, or how often it was asked for: the first few times the bins are searched, so that a fresh shape answers at
  // once.
  mutable std::unique_ptr<std::atomic<std::uintptr_t>[]> cells_;
  mutable std::unique_ptr<std::atomic<float>[]> distances_;  // [m] one a cell, of its centre: see isClear()
  std::size_t cell_total_ = 0;
  mutable std::atomic<std::size_t> cells_filled_{0}, cell_bytes_{0};
  mutable std::once_flag linked_;
  mutable std::vector<std::array<Index, 3>> across_;
  mutable std::vector<std::array<Bend, 3>> bends_;
};

}  // namespace meshless
