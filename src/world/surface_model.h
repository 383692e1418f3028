// What contact in present space needs of a model; bodies of one model share it.
#pragma once

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/contact/surface_contacts.h"

namespace meshless {

struct SurfaceModel {
  explicit SurfaceModel(BodyModelPtr of_model);
  BodyModelPtr model;
  ContactSurface surface;
  std::vector<double> inverse_masses;         // [1/kg] 0 where fixed
  std::vector<double> stiffness;              // stiffnessOfParticles()
  std::size_t bytes() const;                  // without the model
};

}  // namespace meshless
