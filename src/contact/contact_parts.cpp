// Lookups in parts that threads share.
#include "contacts_impl.h"

namespace meshless {
namespace {

constexpr Index kPartSamples = 256;      // points of a part
constexpr std::size_t kMostParts = 64;   // of a task
constexpr std::size_t kLeastTasks = 16;  // where there are parts enough

}  // namespace

void Inside::add(const Inside& other) {
  points += other.points;
  asked += other.asked;
  inside += other.inside;
  near += other.near;
  deepest = std::min(deepest, other.deepest);
}

void LookupParts::add(const std::vector<ContactParty>& parties, const Pair& pair, Index number) {
  if (pair.a == pair.b) {
    parts_.push_back({number, false, 0, 0, {}});
    return;
  }
  for (const bool second : {false, true}) {
    const Index count = samplesFor(pair, *parties[second ? pair.b : pair.a].shape);
    for (Index first = 0; first == 0 || first < count; first += kPartSamples)
      parts_.push_back({number, second, first, std::min(count, first + kPartSamples), {}});
  }
}

std::size_t LookupParts::perTask() const { return std::clamp<std::size_t>(parts_.size() / kLeastTasks, 1, kMostParts); }

// The parts of a task, with what is known of them from before.
void Contacts::Impl::lookUp(std::size_t task, Findings& to, const std::vector<Contact>& known, std::size_t known_end,
                            const std::function<void(LookupPart&)>& look) {
  for (std::size_t k = parts.firstOf(task); k < parts.endOf(task); ++k) {
    LookupPart& part = parts[k];
    if (k == parts.firstOf(task)) startAt(to, known, known_end, pairs[part.pair], part.second);
    look(part);
    part.contacts = to.contacts.size();
    part.entries = to.entries.size();
    part.depths = to.depths.size();
  }
}

}  // namespace meshless
