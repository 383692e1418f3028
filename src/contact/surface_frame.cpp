#include "meshless_surgery/contact/surface_frame.h"

namespace meshless {
namespace {

constexpr double kRidgeCosine = 0.98;  // by which faces turn at a ridge: what is flatter bends less than the skin

Vec3 unitOrZero(const Vec3& v) {
  const double length = v.norm();
  return length > 0.0 ? Vec3(v / length) : Vec3(Vec3::Zero());
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

void placeFrame(const ContactSurface& surface, const Vec3* vertices, const Vec3* velocities, double h,
                SurfaceFrame& frame) {
  const Index count = surface.vertices();
  frame.vertices.assign(vertices, vertices + count);
  placeNormals(surface, frame);
  frame.velocities.resize(count);
  frame.swept.assign(count, FloatBox());
  frame.bounds = Box();
  for (Index v = 0; v < count; ++v) {
    const Vec3& p = frame.vertices[v];
    frame.velocities[v] = velocities ? surface.supports.sum(v, velocities) : Vec3(Vec3::Zero());
    const Vec3 end = p + h * frame.velocities[v];
    frame.swept[v].extend(p);
    frame.swept[v].extend(end);
    frame.bounds.extend(p);
    frame.bounds.extend(end);
  }
  frame.boxes.items.resize(surface.triangles.size());
  for (Index f = 0; f < surface.triangles.size(); ++f) {
    FloatBox box;
    for (const Index v : surface.triangles[f]) box.extend(frame.swept[v]);
    frame.boxes.items[f] = box;
  }
  surface.tree.refit(frame.boxes);
  frame.ridges.clear();
  for (Index e = 0; e < surface.edges.size(); ++e)
    if (isRidge(surface, frame, surface.edges[e])) frame.ridges.push_back(e);
}

void placeNormalBoxes(const ContactSurface& surface, SurfaceFrame& frame) {
  frame.normals.items.resize(surface.triangles.size());
  for (Index f = 0; f < surface.triangles.size(); ++f) {
    Box box{frame.face_normals[f], frame.face_normals[f]};
    for (const Index v : surface.triangles[f]) box.extend(frame.vertex_normals[v]);
    for (int k = 0; k < 3; ++k) {
      frame.normals.items[f].min[k] = static_cast<float>(box.min[k]);
      frame.normals.items[f].max[k] = static_cast<float>(box.max[k]);
    }
  }
  surface.tree.refit(frame.normals);
}

}  // namespace meshless
