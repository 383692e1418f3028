#include <algorithm>

#include "contact_set.h"

namespace meshless {
namespace {

Index rootOf(std::vector<Index>& root, Index i) {
  while (root[i] != i) {
    root[i] = root[root[i]];
    i = root[i];
  }
  return i;
}

}  // namespace

void IslandPlan::make(const std::vector<ShapeCollider>& all, const std::vector<Contact>& made) {
  const Index count = static_cast<Index>(all.size());
  root_.resize(count);
  for (Index p = 0; p < count; ++p) root_[p] = p;
  const auto moves = [&](Index p) { return p != kNoIndex && all[p].moves; };
  moving_.resize(made.size());  // one of each contact, or none: contacts themselves are large
  for (std::size_t k = 0; k < made.size(); ++k) {
    const Contact& c = made[k];
    moving_[k] = moves(c.a) ? c.a : moves(c.b) ? c.b : kNoIndex;
    if (moves(c.a) && moves(c.b)) {
      const Index a = rootOf(root_, c.a), b = rootOf(root_, c.b);
      root_[std::max(a, b)] = std::min(a, b);
    }
  }
  // Islands in the order in which their first contact comes.
  number_.assign(count, kNoIndex);
  contact_offsets.assign(1, 0);
  Index islands = 0;
  for (Index& of : moving_) {
    if (of == kNoIndex) continue;
    const Index root = rootOf(root_, of);
    if (number_[root] == kNoIndex) {
      number_[root] = islands++;
      contact_offsets.push_back(0);
    }
    of = number_[root];
    ++contact_offsets[of + 1];
  }
  for (Index i = 0; i < islands; ++i) contact_offsets[i + 1] += contact_offsets[i];
  contacts.resize(contact_offsets.back());
  next_.assign(contact_offsets.begin(), contact_offsets.end() - 1);
  for (Index k = 0; k < moving_.size(); ++k)
    if (moving_[k] != kNoIndex) contacts[next_[moving_[k]]++] = k;

  collider_offsets.assign(islands + 1, 0);
  shifts.assign(count, kNoIndex);
  const auto island = [&](Index p) { return number_[rootOf(root_, p)]; };
  for (Index p = 0; p < count; ++p)
    if (all[p].moves && island(p) != kNoIndex) ++collider_offsets[island(p) + 1];
  for (Index i = 0; i < islands; ++i) collider_offsets[i + 1] += collider_offsets[i];
  colliders.resize(collider_offsets.back());
  next_.assign(collider_offsets.begin(), collider_offsets.end() - 1);
  Index particles = 0;
  for (Index p = 0; p < count; ++p)
    if (all[p].moves && island(p) != kNoIndex) colliders[next_[island(p)]++] = p;
  for (Index p : colliders) {
    shifts[p] = particles;
    particles += all[p].particles;
  }
}

}  // namespace meshless
