#include "contact_bullet.h"

#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/geometry/mesh/tetrahedralize.h"

namespace meshless::bench {
namespace {

constexpr double kMargin = 0.02;  // of the size; Bullet's own default is a quarter of a metre
constexpr float kPoseMatching = 0.9f, kLinkStiffness = 0.9f, kFriction = 0.5f;
constexpr int kIterations = 4;  // of links and contacts: with one, bodies of VF_SS sink into the ground and turn inside out

btVector3 toBullet(const Vec3& p) { return btVector3(btScalar(p.x()), btScalar(p.y()), btScalar(p.z())); }

}  // namespace

struct BulletPile::Impl {
  PileOptions options;
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btSoftRigidDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  btStaticPlaneShape plane{btVector3(0, 0, 1), 0};
  btRigidBody ground{btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &plane)};
  std::vector<std::unique_ptr<btSoftBody>> bodies;
};

BulletPile::BulletPile(const PileOptions& options, BulletWay way) : impl_(std::make_unique<Impl>()) {
  Impl& w = *impl_;
  w.options = options;
  w.world.setGravity(btVector3(0, 0, -9.81f));
  w.world.getWorldInfo().m_gravity = btVector3(0, 0, -9.81f);
  w.world.getWorldInfo().air_density = 0;
  w.world.getWorldInfo().m_sparsesdf.Initialize();
  w.ground.setFriction(kFriction);
  w.world.addRigidBody(&w.ground);

  BodyDef def;
  def.mesh = boxMesh(Vec3::Constant(options.size), 2, 2, 2);
  def.spacing = 0.5 * options.size;
  def.clusters.kind = ClusterOptions::Kind::kOne;
  def.material.density = 1.0 / (options.size * options.size * options.size);
  def.name = "cube";
  const Result<PreparedBody> cube = prepareBody(def);
  if (!cube) return;
  const BodyModel& model = *cube->model;
  const auto tetrahedra = tetrahedralize(model.rest, SolidQuery(model.surface));
  const auto edges = tetrahedronEdges(tetrahedra);
  std::vector<btScalar> masses;
  for (double m : model.masses) masses.push_back(btScalar(m));
  for (const Pose& pose : startPile(options).poses) {
    std::vector<btVector3> nodes;
    for (const Vec3& p : cube->state.positions) nodes.push_back(toBullet(pose * p));
    w.bodies.push_back(std::make_unique<btSoftBody>(&w.world.getWorldInfo(), static_cast<int>(nodes.size()),
                                                    nodes.data(), masses.data()));
    btSoftBody& body = *w.bodies.back();
    body.m_materials[0]->m_kLST = kLinkStiffness;
    body.m_cfg.kMT = kPoseMatching;
    body.m_cfg.kDF = kFriction;
    for (const Triangle& t : model.surface.triangles)
      body.appendFace(static_cast<int>(t[0]), static_cast<int>(t[1]), static_cast<int>(t[2]));
    if (way == BulletWay::kLinks) {
      for (const auto& edge : edges) body.appendLink(static_cast<int>(edge[0]), static_cast<int>(edge[1]));
      body.m_cfg.collisions = btSoftBody::fCollision::SDF_RS | btSoftBody::fCollision::VF_SS;
    } else {
      body.generateClusters(1);
      body.m_cfg.collisions = btSoftBody::fCollision::SDF_RS | btSoftBody::fCollision::CL_SS;
    }
    body.m_cfg.piterations = kIterations;
    body.setPose(false, true);
    body.getCollisionShape()->setMargin(btScalar(kMargin * options.size));
    body.setActivationState(DISABLE_DEACTIVATION);
    w.world.addSoftBody(&body);
  }
}

BulletPile::~BulletPile() {
  for (auto& body : impl_->bodies) impl_->world.removeSoftBody(body.get());
  impl_->world.removeRigidBody(&impl_->ground);
}

void BulletPile::step() {
  for (int k = 0; k < impl_->options.substeps; ++k)
    impl_->world.stepSimulation(btScalar(1.0 / 60.0 / impl_->options.substeps), 0);
}

std::vector<Points> BulletPile::positions() const {
  std::vector<Points> all;
  for (const auto& body : impl_->bodies) {
    Points points;
    for (int k = 0; k < body->m_nodes.size(); ++k) {
      const btVector3& p = body->m_nodes[k].m_x;
      points.emplace_back(p.x(), p.y(), p.z());
    }
    all.push_back(std::move(points));
  }
  return all;
}

std::size_t BulletPile::contacts() const {
  std::size_t sum = 0;
  for (const auto& body : impl_->bodies)
    sum += static_cast<std::size_t>(body->m_rcontacts.size() + body->m_scontacts.size() + body->m_joints.size());
  return sum;
}

}  // namespace meshless::bench
