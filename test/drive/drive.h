// A random scene, played through and held to laws.
#pragma once

#include "drive/drive_scene.h"
#include "drive/finding.h"
#include "drive/hand.h"
#include "meshless_surgery/world/saved_world.h"

namespace meshless {

struct DriveOptions {
  bool cuts = true;
  bool hands = true;     // false: the scene is left alone from the start
  double budget = 60.0;  // [s] of processor time for steps and looks; beyond it the scene is given up
  bool record = false;   // keep the log of commands and a state
};

struct DriveReport {
  std::uint64_t seed = 0;
  std::string support, organs;                                       // in words
  std::string materials;                                             // names, in the order of the bodies
  std::string family;                                                // elastic, looks or mixed
  std::size_t bodies = 0, pieces = 0, triangles = 0, particles = 0;  // triangles and particles at the start
  HandCounts hand;
  double simulated = 0.0;               // [s]
  double wall = 0.0;                    // [s] of real time that the steps took
  double processor = 0.0;               // [s] of processor time, likewise
  double worst_step = 0.0;              // [s] of processor time
  bool finished = false;                // false: the budget did not do
  std::string refused;                  // why the scene could not be made; empty: it was
  std::array<Finding, kLaws> findings;  // the worst of each law; its text begins with the time
  std::uint64_t hash = 0;               // of the world at the end

  std::string log;          // of the commands, where recorded (world/command_log.h)
  SavedWorldPtr state;      // where recorded: when the first law broke, or at the end
  double state_time = 0.0;  // [s]

  std::size_t broken() const;  // laws
  bool holds() const { return finished && refused.empty() && broken() == 0; }
  /// Worse is more: laws broken first, then by how much.
  double badness() const;
};

/// Half a second to settle, the hand, then alone for five seconds, and longer, up to twenty, where
/// something damps slowly. Laws are checked after every simulated second and at the
/// end; masses, momenta and energies twelve times a second and around each cut. Where the volume of an appearance
/// material leaves the band of elastic ones, the scene is played again without cuts, for a band of its own. Its volume
/// is not judged where the scene did not finish or is not cut.
DriveReport drive(const DriveScene& scene, const DriveOptions& options = {});

}  // namespace meshless
