// How the vertices of a surface follow the particles.
#pragma once

#include "meshless_surgery/body/body.h"

namespace meshless {

/// Of a surface whose vertices are the particles.
SurfaceBinding ownVertices(Index count);

/// The same by at most eight carriers a vertex: those that carry most, with weights that leave it where it is wherever
/// the body moves affinely (moving least squares of degree one, about the weights that they had). Where eight lie in a
/// plane, all stay. For contact, which asks how a vertex moves in every substep, and wants no smooth surface.
SurfaceBinding fewerCarriers(const SurfaceBinding& binding, const Points& rest, double spacing);

/// The same by the corners of each vertex's own cell alone. What moves as one needs no more of them.
SurfaceBinding cornerCarriers(const SurfaceBinding& binding, const CellLattice& lattice, const Points& rest);

/// Where the carriers have the vertices [m].
void carriedPlaces(const SurfaceBinding& binding, const Points& positions, Points& places);

/// What pulls at vertices, as what pulls at the particles that they follow: adds it. It has the same force and torque.
void addToParticles(const SurfaceBinding& binding, const Points& of_vertices, Points& of_particles);

/// Where contact takes the vertices of model.collision to be, which must be there [m].
Points collisionPlaces(const BodyModel& model, const Points& positions);

}  // namespace meshless
