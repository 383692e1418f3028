#include "meshless_surgery/contact/contact_surface.h"

#include <algorithm>

#include "meshless_surgery/base/compressed_rows.h"

namespace meshless {
namespace {

constexpr double kRidgeCosine = 0.98;  // by which faces turn at a ridge: what is flatter bends less than the skin

/// The ends of each face's edges, ascending, and the face; sorted.
std::vector<std::array<Index, 3>> halfEdgesOf(const std::vector<Triangle>& triangles) {
  std::vector<std::array<Index, 3>> half;
  half.reserve(3 * triangles.size());
  for (Index f = 0; f < triangles.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(triangles[f][k], triangles[f][(k + 1) % 3]);
      half.push_back({a, b, f});
    }
  std::sort(half.begin(), half.end());
  return half;
}

Vec3 unitOrZero(const Vec3& v) {
  const double length = v.norm();
  return length > 0.0 ? Vec3(v / length) : Vec3(Vec3::Zero());
}

void placeNormals(const ContactSurface& surface, SurfaceFrame& frame) {
  frame.face_normals.resize(surface.triangles.size());
  frame.vertex_normals.assign(frame.vertices.size(), Vec3::Zero());
  for (Index f = 0; f < surface.triangles.size(); ++f) {
    const Triangle& t = surface.triangles[f];
    const Vec3& a = frame.vertices[t[0]];
    const Vec3 area = (frame.vertices[t[1]] - a).cross(frame.vertices[t[2]] - a);
    frame.face_normals[f] = unitOrZero(area);
    for (const Index v : t) frame.vertex_normals[v] += area;
  }
  for (Vec3& normal : frame.vertex_normals) normal = unitOrZero(normal);
}

}  // namespace

VertexSupports ownSupports(Index vertices) {
  VertexSupports supports;
  for (Index v = 0; v <= vertices; ++v) supports.offsets.push_back(v);
  for (Index v = 0; v < vertices; ++v) supports.particles.push_back(v);
  supports.weights.assign(vertices, 1.0);
  return supports;
}

ContactSurface::ContactSurface(const TriangleMesh& mesh, VertexSupports vertex_supports)
    : rest(mesh.vertices), triangles(mesh.triangles), supports(std::move(vertex_supports)) {
  const Index count = static_cast<Index>(supports.offsets.size() - 1);
  for (const auto& [a, b, face] : halfEdgesOf(triangles)) {
    if (edges.empty() || edges.back().vertices != std::array<Index, 2>{a, b}) {
      const double length = (rest[a] - rest[b]).norm();
      edges.push_back({{a, b}, {face, kNoIndex}, length});
      edge_length += length;
    } else if (edges.back().faces[1] == kNoIndex) {
      edges.back().faces[1] = face;
    }
  }
  if (!edges.empty()) edge_length /= static_cast<double>(edges.size());
  for (const ContactEdge& edge : edges) closed = closed && edge.faces[1] != kNoIndex;
  std::stable_sort(edges.begin(), edges.end(),
                   [](const ContactEdge& x, const ContactEdge& y) { return x.length > y.length; });

  const auto each = [this](const auto& visit) {
    for (Index f = 0; f < triangles.size(); ++f)
      for (const Index v : triangles[f]) visit(v, f);
  };
  compressRows(count, each, face_offsets, faces);

  cut_faces.resize(triangles.size());
  cut_vertices.assign(count, 0);
  Points centres;
  for (Index f = 0; f < triangles.size(); ++f) {
    const Triangle& t = triangles[f];
    cut_faces[f] = isCutPatch(mesh.patchOf(f));
    if (cut_faces[f])
      for (Index v : t) cut_vertices[v] = 1;
    centres.push_back((rest[t[0]] + rest[t[1]] + rest[t[2]]) / 3.0);
  }
  tree = BoxTree(centres);
  vertex_tree = BoxTree(rest);
}

std::size_t ContactSurface::bytes() const {
  return sizeof *this +
         bytesOf(rest, triangles, edges, face_offsets, faces, cut_faces, cut_vertices, supports.offsets,
                 supports.particles, supports.weights) +
         tree.bytes() + vertex_tree.bytes();
}

bool isRidge(const ContactSurface& surface, const SurfaceFrame& frame, const ContactEdge& edge) {
  if (edge.faces[1] == kNoIndex) return true;
  const Vec3& normal = frame.face_normals[edge.faces[0]];
  if (normal.dot(frame.face_normals[edge.faces[1]]) > kRidgeCosine) return false;
  double height = 0.0;  // of the second face over the first
  for (const Index v : surface.triangles[edge.faces[1]])
    height += normal.dot(frame.vertices[v] - frame.vertices[edge.vertices[0]]);
  return height < 0.0;
}

void placeFrame(const ContactSurface& surface, const Vec3* vertices, const Vec3* velocities, double h,
                SurfaceFrame& frame) {
  const Index count = surface.vertices();
  frame.vertices.assign(vertices, vertices + count);
  placeNormals(surface, frame);
  frame.velocities.resize(count);
  frame.points.items.assign(count, FloatBox());
  frame.bounds = Box();
  for (Index v = 0; v < count; ++v) {
    const Vec3& p = frame.vertices[v];
    frame.velocities[v] = velocities ? velocities[v] : Vec3(Vec3::Zero());
    const Vec3 end = p + h * frame.velocities[v];
    frame.points.items[v].extend(p);
    frame.points.items[v].extend(end);
    frame.bounds.extend(p);
    frame.bounds.extend(end);
  }
  frame.faces.items.assign(surface.triangles.size(), FloatBox());
  for (Index f = 0; f < surface.triangles.size(); ++f)
    for (const Index v : surface.triangles[f]) frame.faces.items[f].extend(frame.points.items[v]);
  surface.vertex_tree.refit(frame.points);
  surface.tree.refit(frame.faces);
}

void placeNormalBoxes(const ContactSurface& surface, SurfaceFrame& frame) {
  const auto place = [](const BoxTree& tree, const Points& normals, TreeBoxes& turns) {
    turns.items.assign(normals.size(), FloatBox());
    for (Index n = 0; n < normals.size(); ++n) turns.items[n].extend(normals[n]);
    tree.refit(turns);
  };
  place(surface.vertex_tree, frame.vertex_normals, frame.point_turns);
  place(surface.tree, frame.face_normals, frame.face_turns);
}

}  // namespace meshless
