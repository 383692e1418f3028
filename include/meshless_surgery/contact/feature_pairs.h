// Narrow phase: which features of two surfaces, or of a surface and a plane or sphere, are near each other in a frame,
// and on which side. Pure functions: they read surfaces and what was remembered, and append to their results.
#pragma once

#include <limits>

#include "meshless_surgery/contact/contact_surface.h"

namespace meshless {

/// A point of surface a (a vertex, or on a ridge) near a point of a face of surface b, or of what has no surface.
struct FeaturePair {
  enum class Kind : std::uint8_t { kVertexFace, kPlane, kSphere };
  Kind kind = Kind::kVertexFace;
  std::uint8_t order = 0;           // among those of one vertex
  std::uint8_t of_a = 1, of_b = 3;  // how many of the vertices are of a, then of b
  std::array<Index, 2>
      features{};  // names it in the next frame: a vertex and kNoIndex, or a ridge, counted on, and a number
  std::array<Index, 5> vertices{};  // first those of a
  std::array<double, 5> shares{};   // of the vertices; add up to 1 for a, to -1 for b
  Vec3 normal = Vec3::UnitZ();      // unit, from b to a
  double gap = 0.0;                 // [m] along it; negative: inside
  double area = 0.0;                // [m^2] of kSphere: of the sphere, that the point stands for
};

/// The side on which a vertex of a was of b: its normal says where out is once it is inside.
struct RememberedSide {
  Index vertex = 0;
  double depth = 0.0;  // [m] how deep inside
  Vec3 normal = Vec3::UnitZ();
};

enum class Layers : std::uint8_t { kUnknown, kNone, kOne, kMore };  // of tissue

/// A face near a vertex.
struct NearFace {
  Index face = 0;
  Vec3 weights, point;
  double distance = 0.0, reach = 0.0;
  int corners = 0;  // of the face that the nearest point lies between: 1 at a vertex, 2 on an edge, 3 inside
  Layers behind = Layers::kUnknown;  // it and the point that it is near to, beyond what overlaps: kOne, or kNone
};

/// What a search finds, and its scratch.
struct SearchScratch {
  std::vector<FeaturePair> pairs;
  std::vector<RememberedSide> sides;  // to be remembered
  std::vector<NearFace> faces;        // of one vertex
  std::vector<Index> order;           // of these
  struct Met {
    Index face, next;  // in the list, of the same vertex
  };
  std::vector<Met> met;      // faces that vertices may meet
  std::vector<Index> first;  // one a vertex: of met; kNoIndex: none
  std::vector<std::array<Index, 2>> stack;
  std::vector<Layers> behind;  // one a face of a surface that meets itself
};

struct PairSearch {
  struct Side {
    const ContactSurface* surface = nullptr;
    const SurfaceFrame* frame = nullptr;
  };
  Side a, b;
  double h = 0.0;                                            // [s] of the frame
  double length = 0.0;                                       // [m] the shorter mean edge of the two
  double spacing = std::numeric_limits<double>::infinity();  // [m] of points on long ridges of a
  bool first = true;                                         // nothing is remembered: search for what is inside
  enum class Self { kNo, kCuts, kAll } self = Self::kNo;
  const RememberedSide* remembered = nullptr;  // ascending by vertex
  std::size_t remembered_count = 0;
};

/// [m] The margin of a search at rest, beside what is swept, of surfaces with such a mean edge.
inline double searchMargin(double edge_length) { return 0.2 * edge_length; }

/// Vertices of a, and points on its long ridges, against the faces of b: up to three pairs each, of different
/// directions, the nearest first. Signs by pseudonormals (Baerentzen and Aanaes 2005); where several faces are equally
/// near, the vertex is on the side of the one that its own faces oppose most, so that the twin faces of a fresh cut are
/// on the right sides. Directions that the vertex's faces do not oppose are left out. Returns the vertices that were
/// queried.
std::size_t findVertexFace(const PairSearch& search, SearchScratch& scratch);

/// Vertices of a over the plane z = height.
void findPlane(const PairSearch& search, double height, std::vector<FeaturePair>& pairs);

/// A sphere that is pushed into a surface.
struct SphereTouch {
  Vec3 centre = Vec3::Zero(), way = Vec3::Zero();  // [m] at the start of the frame, and in it
  double radius = 0.0;                             // [m]
  Vec3 force = Vec3::Zero();  // [N] on the surface, when it was found last: says where its middle is, and how wide
  double modulus = 0.0;       // [Pa] E / (1 - nu^2) of what is behind the surface; 0: nobody knows
  double spacing = 0.0;       // [m] of what carries the surface
};

/// Points of a's faces where rays from the centre of a sphere meet them first, even and dense about the middle of what
/// it touches: two in the radius of a Hertz contact, no farther apart than 0.7 spacings. So the force does not
/// depend on where the sphere lies on the faces, and their number does not depend on how fine these are.
void findSphere(const PairSearch& search, const SphereTouch& touch, std::vector<FeaturePair>& pairs);

}  // namespace meshless
