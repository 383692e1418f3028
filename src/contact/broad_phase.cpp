#include "meshless_surgery/contact/broad_phase.h"

#include <algorithm>
#include <cmath>

namespace meshless {
namespace {

constexpr std::uint64_t kNoKey = ~0ull;
constexpr int kNoLevel = 1 << 20;
constexpr double kWider = 0.05;         // of a box's extent: the margin
constexpr int kWithout = 8;             // searches without margins after one that held for fewer calls than kWorthIt
constexpr double kMostCells = 1 << 18;  // coordinates that still fit into 19 bits of a key

std::uint64_t keyOf(int level, const std::array<std::int64_t, 3>& cell) {
  std::uint64_t key = static_cast<std::uint64_t>(level & 0x3f);
  for (std::int64_t c : cell) key = (key << 19) | (static_cast<std::uint64_t>(c) & 0x7ffff);
  return key;
}

std::size_t hashOf(std::uint64_t key) {
  key ^= key >> 31;
  key *= 0x9e3779b97f4a7c15ull;
  return static_cast<std::size_t>(key ^ (key >> 29));
}

}  // namespace

bool BroadPhase::stillWithin(const std::vector<Box>& boxes, const std::vector<char>& active) const {
  if (boxes.size() != wide_.size() || active != wide_active_) return false;
  for (std::size_t i = 0; i < boxes.size(); ++i)
    if (!((boxes[i].min.array() >= wide_[i].min.array()).all() && (boxes[i].max.array() <= wide_[i].max.array()).all()))
      return false;
  return true;
}

const std::vector<std::array<Index, 2>>& BroadPhase::find(const std::vector<Box>& boxes,
                                                          const std::vector<char>& active) {
  tested_ = 0;
  if (stillWithin(boxes, active)) {
    ++held_;
  } else {
    // Where all moves, margins only find more that is to be compared.
    if (without_ > 0)
      --without_;
    else if (held_ < kWorthIt)
      without_ = kWithout;
    wide_ = boxes;
    wide_active_ = active;
    for (Box& box : wide_) {
      const double margin = without_ == 0 ? kWider * (box.max - box.min).maxCoeff() : 0.0;
      if (!(margin > 0.0)) continue;  // and empty ones stay so
      box.min.array() -= margin;
      box.max.array() += margin;
    }
    search(wide_, active, wide_pairs_);
    held_ = 0;
  }
  tested_ += wide_pairs_.size();
  pairs_.clear();
  for (const auto& pair : wide_pairs_)
    if (boxes[pair[0]].overlaps(boxes[pair[1]])) pairs_.push_back(pair);
  return pairs_;
}

void BroadPhase::search(const std::vector<Box>& boxes, const std::vector<char>& active,
                        std::vector<std::array<Index, 2>>& pairs) {
  pairs.clear();
  entries_.clear();
  level_of_.assign(boxes.size(), kNoLevel);
  Box region;
  double largest = 0.0;
  for (const Box& box : boxes) {
    if (box.empty() || !box.min.allFinite() || !box.max.allFinite()) continue;
    region.extend(0.5 * (box.min + box.max));
    largest = std::max(largest, (box.max - box.min).maxCoeff());
  }
  if (region.empty()) return;
  // The finest level: cells as large as the largest box of the level; none so fine that a coordinate would not fit.
  const double extent = (region.max - region.min).maxCoeff();
  const double finest = std::max({extent / kMostCells, largest * std::ldexp(1.0, -60), 1e-300});
  std::array<bool, 64> used{};
  for (Index i = 0; i < boxes.size(); ++i) {
    const Box& box = boxes[i];
    if (box.empty() || !box.min.allFinite() || !box.max.allFinite()) continue;
    const double size = std::max((box.max - box.min).maxCoeff(), finest);
    const int level = std::clamp(static_cast<int>(std::ceil(std::log2(size / finest) - 1e-12)), 0, 63);
    level_of_[i] = level;
    used[static_cast<std::size_t>(level)] = true;
  }
  const auto cellOf = [&](const Box& box, int level) {
    const double edge = std::ldexp(finest, level);
    std::array<std::int64_t, 3> cell;
    for (int d = 0; d < 3; ++d)
      cell[d] = static_cast<std::int64_t>((0.5 * (box.min[d] + box.max[d]) - region.min[d]) / edge) + 1;
    return cell;
  };
  for (Index i = 0; i < boxes.size(); ++i)
    if (level_of_[i] != kNoLevel) entries_.push_back({keyOf(level_of_[i], cellOf(boxes[i], level_of_[i])), i});
  std::sort(entries_.begin(), entries_.end(),
            [](const Entry& a, const Entry& b) { return a.key != b.key ? a.key < b.key : a.box < b.box; });
  std::size_t slots = 64;
  while (slots < 2 * entries_.size()) slots *= 2;
  table_.resize(slots);
  table_keys_.assign(slots, kNoKey);
  for (Index first = 0; first < entries_.size();) {
    Index end = first + 1;
    while (end < entries_.size() && entries_[end].key == entries_[first].key) ++end;
    std::size_t slot = hashOf(entries_[first].key) & (slots - 1);
    while (table_keys_[slot] != kNoKey) slot = (slot + 1) & (slots - 1);
    table_keys_[slot] = entries_[first].key;
    table_[slot] = {first, end};
    first = end;
  }
  // Of two levels the finer one finds.
  for (Index i = 0; i < boxes.size(); ++i) {
    if (level_of_[i] == kNoLevel) continue;
    for (int level = level_of_[i]; level < 64; ++level) {
      if (!used[static_cast<std::size_t>(level)]) continue;
      const std::array<std::int64_t, 3> centre = cellOf(boxes[i], level);
      const bool own = level == level_of_[i];
      std::array<std::int64_t, 3> cell;
      for (cell[0] = centre[0] - (own ? 0 : 1); cell[0] <= centre[0] + 1; ++cell[0])
        for (cell[1] = centre[1] - 1; cell[1] <= centre[1] + 1; ++cell[1])
          for (cell[2] = centre[2] - 1; cell[2] <= centre[2] + 1; ++cell[2]) {
            // Of two cells on one level the one that comes first is compared with the other.
            if (own && cell < centre) continue;
            const bool same = cell == centre;
            const std::uint64_t key = keyOf(level, cell);
            std::size_t slot = hashOf(key) & (slots - 1);
            while (table_keys_[slot] != kNoKey && table_keys_[slot] != key) slot = (slot + 1) & (slots - 1);
            if (table_keys_[slot] == kNoKey) continue;
            for (Index k = table_[slot][0]; k < table_[slot][1]; ++k) {
              const Index j = entries_[k].box;
              if ((own && same && j <= i) || (!active[i] && !active[j])) continue;
              ++tested_;
              if (boxes[i].overlaps(boxes[j])) pairs.push_back({std::min(i, j), std::max(i, j)});
            }
          }
    }
  }
  std::sort(pairs.begin(), pairs.end());
}

}  // namespace meshless
