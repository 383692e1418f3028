// Bodies of filled cells are held where their regions are.
#include "meshless_surgery/body/clamp.h"

#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/body/deform.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"

namespace meshless {
namespace clamp_test {

BodyDef barHeldBelow(const Plane& plane) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.08, 0.031, 0.027), 0.006));
  def.spacing = 0.01;
  def.material.youngs_modulus = 5000.0;
  def.material.poissons_ratio = 0.4;
  def.material.damping = 20.0;
  def.fixed = {{Region::below(plane), false}};
  return def;
}

BodyState stepped(const PreparedBody& body, const Vec3& gravity, int steps) {
  BodyState state = body.state;
  StepScratch scratch;
  MatchCounters counters;
  const double h = 0.5 / body.model->highest_frequency;
  for (int n = 0; n < steps; ++n) {
    matchAndMove(*body.model, body.def.material, gravity, h, state, scratch, counters);
    velocitiesFromPositions(h, state, scratch);
  }
  updateSurface(*body.model, state);
  return state;
}

// Any plane across the bar: places on it hardly move, and what is held not at all, but for what lies nearer to the
// plane than samples see.
TEST(Clamp, HoldsWhatIsBelowAPlaneWhereverItIs) {
  for (const Vec3& normal : {Vec3(1, 0, 0), Vec3(2, 1, 0), Vec3(3, -1, 2)})
    for (const double at : {-0.04, -0.031, -0.0284, -0.02, -0.0177}) {
      if (at == -0.04 && normal.y() != 0.0) continue;  // a face
      const Plane plane{normal.normalized(), Vec3(at, 0, 0)};
      const PreparedBody body = test::prepared(barHeldBelow(plane));
      ASSERT_TRUE(body.model->any_fixed);
      const BodyState state = stepped(body, Vec3(0, 0, -0.5), 3000);
      double most = 0.0, border = 0.0, area = 0.0;
      for (std::size_t v = 0; v < state.surface.size(); ++v) {
        const double moved = (state.surface[v] - body.state.surface[v]).norm();
        most = std::max(most, moved);
        if (plane.height(body.state.surface[v]) < -0.25 * body.model->spacing * plane.normal.lpNorm<1>()) {
          EXPECT_LT(moved, 1e-12) << normal.transpose() << " at " << at;
        }
      }
      for (const ClampPoint& point : body.model->clamp_points) {
        const LatticeCell& cell = body.model->lattice->cells[point.cell];
        Vec3 moved = Vec3::Zero();
        for (int k = 0; k < 8; ++k)
          moved +=
              trilinearWeight(k, point.at) * (state.positions[cell.corners[k]] - body.state.positions[cell.corners[k]]);
        border += point.area * moved.squaredNorm();
        area += point.area;
        EXPECT_NEAR(plane.height(body.state.placed * body.model->lattice->restPlace(cell, point.at)), 0.0, 1e-9);
      }
      EXPECT_NEAR(area * std::abs(plane.normal.x()), 0.031 * 0.027, 0.3 * 0.031 * 0.027);  // as samples see it
      EXPECT_GT(most, 1e-4);
      EXPECT_LT(std::sqrt(border / area), 0.01 * most) << normal.transpose() << " at " << at;
    }
}

// Stretched tissue has another highest frequency and takes other substeps, as it moves. What holds it gives it no
// energy by that.
TEST(Clamp, WhatHangsComesToRest) {
  for (const int seed : {1, 2}) {
    BodyDef def = test::defOf(*randomOrgan(static_cast<std::uint64_t>(seed), seed - 1, 0.1, 1000));
    def.spacing = 0.01;
    def.material.youngs_modulus = 2500.0;
    def.material.poissons_ratio = 0.45;
    def.material.damping = 10.0;
    def.fixed = {{Region::below({Vec3(1, 0.3, 0.1).normalized(), Vec3(-0.02, 0, 0)}), false}};
    const PreparedBody body = test::prepared(def);
    for (double pull = 3.9; pull < 8.0; pull *= 1.06) {
      SCOPED_TRACE("organ " + std::to_string(seed) + " at " + std::to_string(pull) + " m/s^2");
      BodyState state = body.state;
      StepScratch scratch;
      MatchCounters counters;
      double last = 0.0;
      std::size_t changes = 0;  // of the substep
      for (int frame = 0; frame < 240; ++frame) {
        const double substeps = substepsNeeded(*body.model, state, 1.0 / 120.0), h = 1.0 / (120.0 * substeps);
        changes += std::exchange(last, h) != h;
        for (int k = 0; k < substeps; ++k) {
          matchAndMove(*body.model, def.material, pull * Vec3(1.0, 0.0, -0.3), h, state, scratch, counters);
          velocitiesFromPositions(h, state, scratch);
        }
      }
      double fastest = 0.0;
      for (const Vec3& v : state.velocities) fastest = std::max(fastest, v.norm());
      EXPECT_LT(fastest, 1e-3);
      EXPECT_EQ(scratch.clamp.factorised(), changes) << "a clamp's springs are those of the body at rest";
    }
  }
}

// The body, its clamp and what pulls are turned: all that follows is turned, to rounding.
TEST(Clamp, TurnsWithItsBody) {
  BodyDef def = barHeldBelow({Vec3(1, 0.2, 0.1).normalized(), Vec3(-0.025, 0, 0)});
  const PreparedBody straight = test::prepared(def);
  def.pose = {Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized())), Vec3(0.3, -0.1, 0.2)};
  const PreparedBody turned = test::prepared(def);
  const Vec3 gravity(0.3, 0.5, -2.0);
  const BodyState a = stepped(straight, gravity, 200), b = stepped(turned, def.pose.rotation * gravity, 200);
  ASSERT_EQ(a.surface.size(), b.surface.size());
  double most = 0.0;
  for (std::size_t v = 0; v < a.surface.size(); ++v) {
    EXPECT_LT((def.pose * a.surface[v] - b.surface[v]).norm(), 1e-11);
    most = std::max(most, (a.surface[v] - straight.state.surface[v]).norm());
  }
  EXPECT_GT(most, 1e-4);
  const PreparedBody copy = placedCopy(straight, "copy", def.pose);
  const BodyState c = stepped(copy, def.pose.rotation * gravity, 200);
  for (std::size_t v = 0; v < a.surface.size(); ++v) EXPECT_LT((c.surface[v] - b.surface[v]).norm(), 1e-11);
}

// A thin layer at a face, a ball in the middle and a patch of the surface hold too.
TEST(Clamp, HoldsBoxesAndBalls) {
  BodyDef def = barHeldBelow({Vec3::UnitX(), Vec3::Zero()});
  for (const Region& region : {Region(Vec3(-1, -1, -1), Vec3(-0.0395, 1, 1)), Region::sphere(Vec3(0.01, 0, 0), 0.009),
                               Region::sphere(Vec3(0.04, 0.0155, 0.0135), 0.012)}) {
    def.fixed = {{region, true}};
    const PreparedBody body = test::prepared(def);
    EXPECT_FALSE(body.model->clamp_points.empty()) << region.text();
    const BodyState state = stepped(body, Vec3(0, 0, -0.5), 2000);
    double lowest = 0.0;
    for (std::size_t v = 0; v < state.surface.size(); ++v)
      lowest = std::max(lowest, (state.surface[v] - body.state.surface[v]).norm());
    EXPECT_LT(lowest, 0.02) << region.text();  // in free fall it were 0.3 m
  }
}

// A face is clamped by a box over it, however thin that is beside the samples: the bar hangs as from the half space
// there.
TEST(Clamp, HoldsAFaceByABoxThatIsThinnerThanSamples) {
  BodyDef def = barHeldBelow({Vec3::UnitX(), Vec3(-0.04, 0, 0)});
  const Vec3 gravity(0, 0, -0.5);
  const BodyState by_plane = stepped(test::prepared(def), gravity, 700);
  double most = 0.0;
  for (std::size_t v = 0; v < by_plane.surface.size(); ++v)
    most = std::max(most, std::abs(by_plane.surface[v].z() - test::prepared(def).state.surface[v].z()));
  ASSERT_GT(most, 1e-4);
  for (const auto& [from, to] : {std::pair(-0.04005, -0.03995), {-0.0401, -0.04}}) {
    SCOPED_TRACE(std::to_string(from) + " to " + std::to_string(to));
    def.fixed = {{Region(Vec3(from, -1, -1), Vec3(to, 1, 1)), false}};
    const BodyState by_box = stepped(test::prepared(def), gravity, 700);
    double apart = 0.0;
    for (std::size_t v = 0; v < by_plane.surface.size(); ++v)
      apart = std::max(apart, (by_plane.surface[v] - by_box.surface[v]).norm());
    EXPECT_LT(apart, 0.02 * most);
  }
  // Across the middle it holds both halves, also askew.
  def.fixed = {{Region(Vec3(-5e-5, -1, -1), Vec3(5e-5, 1, 1)), true}};
  def.pose.rotation = Quat::FromTwoVectors(Vec3(3, 1, 0.5), Vec3::UnitX());
  const PreparedBody body = test::prepared(def);
  const BodyState state = stepped(body, gravity, 700);
  for (std::size_t v = 0; v < state.surface.size(); ++v)
    if (std::abs(body.state.surface[v].x()) < 0.003)
      EXPECT_LT((state.surface[v] - body.state.surface[v]).norm(), 1e-4) << body.state.surface[v].transpose();
}

TEST(Clamp, RefusesARegionThatHoldsNothing) {
  const BodyDef def = barHeldBelow({Vec3::UnitX(), Vec3(-0.05, 0, 0)});
  const Result<PreparedBody> refused = prepareBody(def);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(refused.error().detail.find("fixed[0], what is below the plane through -0.05"), std::string::npos)
      << refused.error().detail;
}

// Of a bar that is cut across, the part at the clamp hangs on, and the other one falls.
TEST(Clamp, HoldsItsPieceAfterACut) {
  const PreparedBody body = test::prepared(barHeldBelow({Vec3::UnitX(), Vec3(-0.0284, 0, 0)}));
  const Result<CutBody> cut =
      cutBody(*body.model, body.state, Blade::through(Plane{Vec3(1, 0.1, 0).normalized(), Vec3(0.01, 0, 0)}));
  ASSERT_TRUE(cut.ok());
  ASSERT_EQ(cut->pieces.size(), 2u);
  const auto lowest = [](const BodyPiece& piece) {
    double low = 1.0;
    for (const Vec3& v : piece.model->surface.vertices) low = std::min(low, v.x());
    return low;
  };
  const bool first = lowest(cut->pieces[0]) < lowest(cut->pieces[1]);
  const BodyModel &held = *cut->pieces[first ? 0 : 1].model, &free = *cut->pieces[first ? 1 : 0].model;
  EXPECT_TRUE(free.clamp_points.empty());
  EXPECT_FALSE(free.any_fixed);
  EXPECT_EQ(held.clamp_points.size(), body.model->clamp_points.size());
  EXPECT_TRUE(held.clamp);
}

}  // namespace clamp_test
}  // namespace meshless
