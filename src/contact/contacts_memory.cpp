// What a frame reads of the ones before it: kept beside the world's state, and given back.
#include "meshless_surgery/contact/contacts_memory.h"

#include "contacts_impl.h"

namespace meshless {

// Structured bindings: a field that is added and not kept does not compile.
template <class Archive>
void serialize(Archive& archive, Contact& contact) {
  auto& [a, b, sample, triangle, direct, caught, below, flipped, point, share, corners, weights, first, split, end,
         offset, normal, answer, impulse, slip_impulse] = contact;
  static_cast<void>(answer);  // within a frame alone
  archive(a, b, sample, triangle, direct, caught, below, flipped, point, share, corners, weights, first, split, end,
          offset, normal, impulse, slip_impulse);
}

namespace {

struct CaughtPoint {
  std::uint64_t a = 0, b = 0;
  Index sample = 0, triangle = 0;
};
template <class Archive>
void serialize(Archive& archive, CaughtPoint& point) {
  archive(point.a, point.b, point.sample, point.triangle);
}

struct ExitOfPair {
  std::uint64_t a = 0, b = 0;
  Vec3 direction = Vec3::UnitZ();
  double speed = 0.0;
};
template <class Archive>
void serialize(Archive& archive, ExitOfPair& exit) {
  archive(exit.a, exit.b, exit.direction, exit.speed);
}

}  // namespace

struct ContactsMemory::Data {
  std::vector<Contact> contacts;
  std::uint64_t steady_contacts = 0, frames = 0;
  std::vector<CaughtPoint> caught;
  std::vector<ExitOfPair> exits;
  std::vector<std::uint64_t> keys;
  std::vector<Index> reached;
  std::int32_t needed_substeps = 1, affordable_substeps = kAnySubsteps, standing_substeps = 1;
  double impulse_substep = 0.0;

  template <class Archive>
  void fields(Archive& archive) {
    archive(contacts, steady_contacts, frames, caught, exits, keys, reached, needed_substeps, affordable_substeps,
            standing_substeps, impulse_substep);
  }
};

ContactsMemory::ContactsMemory() : data_(std::make_unique<Data>()) {}
ContactsMemory::~ContactsMemory() = default;
ContactsMemory::ContactsMemory(ContactsMemory&&) noexcept = default;
ContactsMemory& ContactsMemory::operator=(ContactsMemory&&) noexcept = default;
ContactsMemory::ContactsMemory(const ContactsMemory& other) : data_(std::make_unique<Data>(*other.data_)) {}
ContactsMemory& ContactsMemory::operator=(const ContactsMemory& other) {
  *data_ = *other.data_;
  return *this;
}

void save(OutArchive& archive, const ContactsMemory& memory) { memory.data_->fields(archive); }
// Without keys: they are other ones for the same bodies after a reset.
void save(HashArchive& archive, const ContactsMemory& memory) {
  const ContactsMemory::Data& data = *memory.data_;
  archive(data.contacts, data.steady_contacts, data.frames, data.reached, data.needed_substeps,
          data.affordable_substeps, data.standing_substeps, data.impulse_substep);
  for (const CaughtPoint& point : data.caught) archive(point.sample, point.triangle);
  for (const ExitOfPair& exit : data.exits) archive(exit.direction, exit.speed);
}
void load(InArchive& archive, ContactsMemory& memory) { memory.data_->fields(archive); }

std::string ContactsMemory::fault(const std::map<std::uint64_t, KnownCollider>& colliders) const {
  // Of a collider that is gone nothing is queried.
  const auto fits = [&](std::uint64_t key, Index triangle) {
    const auto known = colliders.find(key);
    return known == colliders.end() || triangle < known->second.triangles;
  };
  for (const Contact& c : data_->contacts) {
    if (c.a >= data_->keys.size()) return "a contact is of collider " + std::to_string(c.a);
    if (c.b == kNoIndex) continue;
    if (c.b >= data_->keys.size()) return "a contact is of collider " + std::to_string(c.b);
    if (!fits(data_->keys[c.b], c.triangle)) return "a contact's triangle is " + std::to_string(c.triangle);
  }
  for (const CaughtPoint& point : data_->caught)
    if (!fits(point.b, point.triangle)) return "a caught point's triangle is " + std::to_string(point.triangle);
  for (const Index collider : data_->reached)
    if (collider >= data_->keys.size()) return "a collider that was reached is " + std::to_string(collider);
  if (data_->needed_substeps < 1 || data_->needed_substeps > kAnySubsteps)
    return "contacts ask for " + std::to_string(data_->needed_substeps) + " substeps";
  if (data_->affordable_substeps < 1 || data_->affordable_substeps > kAnySubsteps)
    return "contacts leave " + std::to_string(data_->affordable_substeps) + " substeps";
  if (data_->standing_substeps < 1 || data_->standing_substeps > kAnySubsteps)
    return "stacks ask for " + std::to_string(data_->standing_substeps) + " substeps";
  if (data_->impulse_substep != 0.0 && !(data_->impulse_substep >= 1e-9 && data_->impulse_substep <= 1.0))
    return "the last substep of contacts took " + std::to_string(data_->impulse_substep) + " s";
  return "";
}

ContactsMemory Contacts::memory() const {
  ContactsMemory memory;
  ContactsMemory::Data& data = *memory.data_;
  const Impl& w = *impl_;
  data.contacts = w.contacts;
  data.steady_contacts = w.steady_contacts;
  data.frames = w.frames;
  for (const auto& [key, triangle] : w.caught) data.caught.push_back({key.a, key.b, key.sample, triangle});
  for (const auto& [key, exit] : w.exits) data.exits.push_back({key.first, key.second, exit.direction, exit.speed});
  data.keys = w.keys;
  data.reached = w.reached;
  data.needed_substeps = w.needed_substeps;
  data.affordable_substeps = w.affordable_substeps;
  data.standing_substeps = w.standing_substeps;
  data.impulse_substep = w.impulse_substep;
  return memory;
}

void Contacts::recall(const ContactsMemory& memory) {
  clear();
  const ContactsMemory::Data& data = *memory.data_;
  Impl& w = *impl_;
  w.contacts = data.contacts;
  w.steady_contacts = static_cast<std::size_t>(data.steady_contacts);
  w.frames = static_cast<std::size_t>(data.frames);
  for (const CaughtPoint& point : data.caught) w.caught[{point.a, point.b, point.sample}] = point.triangle;
  for (const ExitOfPair& exit : data.exits) w.exits[{exit.a, exit.b}] = {exit.direction, exit.speed};
  w.keys = data.keys;
  w.reached = data.reached;
  w.needed_substeps = data.needed_substeps;
  w.affordable_substeps = data.affordable_substeps;
  w.standing_substeps = data.standing_substeps;
  w.impulse_substep = data.impulse_substep;
}

}  // namespace meshless
