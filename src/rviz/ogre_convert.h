// Messages to Ogre's values and back.
#pragma once

#include <vector>

#include <OgreQuaternion.h>
#include <OgreVector.h>
#include <geometry_msgs/Point.h>
#include <geometry_msgs/Quaternion.h>
#include <geometry_msgs/Vector3.h>
#include <meshless_surgery/Surface.h>

namespace meshless {

inline Ogre::Vector3 toOgre(const geometry_msgs::Point& p) { return Ogre::Vector3(p.x, p.y, p.z); }
inline Ogre::Vector3 toOgre(const geometry_msgs::Vector3& v) { return Ogre::Vector3(v.x, v.y, v.z); }
inline Ogre::Quaternion toOgre(const geometry_msgs::Quaternion& q) { return Ogre::Quaternion(q.w, q.x, q.y, q.z); }

inline Ogre::Vector3 vertexOf(const std::vector<float>& vertices, std::uint32_t v) {
  return Ogre::Vector3(vertices[3 * v], vertices[3 * v + 1], vertices[3 * v + 2]);
}

inline Ogre::Vector3 vertexOf(const meshless_surgery::Surface& surface, std::uint32_t v) {
  return vertexOf(surface.vertices, v);
}

inline geometry_msgs::Point toPoint(const Ogre::Vector3& v) {
  geometry_msgs::Point point;
  point.x = v.x;
  point.y = v.y;
  point.z = v.z;
  return point;
}
inline geometry_msgs::Vector3 toVector(const Ogre::Vector3& v) {
  geometry_msgs::Vector3 vector;
  vector.x = v.x;
  vector.y = v.y;
  vector.z = v.z;
  return vector;
}
inline geometry_msgs::Quaternion toQuaternion(const Ogre::Quaternion& q) {
  geometry_msgs::Quaternion quaternion;
  quaternion.x = q.x;
  quaternion.y = q.y;
  quaternion.z = q.z;
  quaternion.w = q.w;
  return quaternion;
}

}  // namespace meshless
