// Scene and material files (YAML). Unknown keys are errors with file, line and the nearest known key.
#pragma once

#include "meshless_surgery/io/image_file.h"
#include "meshless_surgery/world/world.h"

namespace meshless {

/// Reads a scene and every mesh that it names. `file` is a path; meshes are relative to it, absolute or package://, and
/// may lie below access.folders or the scene's own folder. Materials are known by name from, later ones over earlier
/// ones: config/materials of this package (where access finds packages), ../materials beside the scene's folder (where
/// access allows it), the scene itself; SceneDef::materials holds them all.
/// Errors read "<file>:<line>: <what>; accepted: <range>". At most 10,000 bodies.
///
/// world: gravity [x, y, z], ground (a height or none), ground_friction, step_rate, substeps, contact (textbook, none),
///        pick: {max_distance, stiffness, radius}, push: {radius}
/// materials: {NAME: {mode, alpha, beta, density, damping, friction, color, inside_color, ...}}. A noise or an image
///            of an appearance that cannot be had is a warning, and the look is plain
/// bodies: a list of
///   name          absent: the file's name or the primitive's kind
///   file | primitive: {box: [x, y, z]} | {sphere: radius} | {cylinder: [height, radius]}, with edge: [m] of triangles
///   scale, spacing, pose: {position, rpy (turned about the fixed x, then y, then z axis) | xyzw}
///   clusters      auto | one | {grid: [x, y, z], overlap} | {count, overlap}
///   material      a name, or a map of keys over the defaults
///   fixed         a list of {box: {min, max}}
///   copies        {count, grid: [x, y, z], offset: [x, y, z], jitter, turn, seed}: the body `count` times, named
///   NAME_1,
///                 NAME_2 ..., in cells of a grid (x first) `offset` apart, each moved by up to `jitter` [m] along
///                 every axis and turned by up to `turn` [rad] about any, by a generator that `seed` starts
/// instruments: {NAME: {type: probe | grasper | hook | scissors, pose, max_force, grip, friction, remote_centre, ...}}
/// attachments: a list of {bodies: [name, name], distance, stiffness, strength, region: {box | plane | sphere}, name};
///              one of the names may be an obstacle's or `world`
Result<SceneDef> readScene(const std::string& file, const FileAccess& access);

/// Every *.yaml of a folder, by name: a map of names to materials each; later files override earlier ones. Looks with
/// images are plain.
Result<std::map<std::string, Material>> readMaterials(const std::string& folder);

/// `base` with the keys of a YAML map changed (mode, alpha, beta, density, damping, friction, color, inside_color ...).
/// Images are taken from `folder` on; `warnings` gets what could be done without. Refused too: a key that the changed
/// material has no use for, as it is elastic or not.
Result<Material> changeMaterial(const Material& base, const std::string& yaml, ImageFiles& images,
                                const std::string& folder, std::vector<std::string>& warnings);

/// Of an entry of `instruments`: a YAML map {type: grasper, max_force: N, ...}.
Result<InstrumentDef> readInstrument(const std::string& name, const std::string& yaml);

/// `empty`, or a YAML map {pressure: Pa}, {volume: ml, compliance: ml/Pa}, with leak: s. An empty text: empty.
Result<CavityFill> readCavityFill(const std::string& yaml);

/// Closed surface of a box {x, y, z}, sphere {radius} or cylinder {height, radius} [m], centred at the origin, with
/// triangles of about `edge` [m]; 0: about 600 of them. Refuses other kinds and sizes that are not 1e-4 to 1000 m.
Result<TriangleMesh> primitiveMesh(const std::string& kind, const std::vector<double>& sizes, double edge = 0.0);

}  // namespace meshless
