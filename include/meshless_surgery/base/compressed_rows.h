// Numbers in rows of any length: those of row r are entries[offsets[r]] .. entries[offsets[r + 1] - 1].
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

/// each(visit) calls visit(row, entry) in the order in which the entries of a row are to stand; it is called twice.
template <class Each>
void compressRows(std::size_t rows, const Each& each, std::vector<Index>& offsets, std::vector<Index>& entries) {
  offsets.assign(rows + 1, 0);
  each([&](Index row, Index) { ++offsets[row + 1]; });
  for (std::size_t r = 0; r < rows; ++r) offsets[r + 1] += offsets[r];
  entries.resize(offsets[rows]);
  std::vector<Index> next(offsets.begin(), offsets.end() - 1);
  each([&](Index row, Index entry) { entries[next[row]++] = entry; });
}

}  // namespace meshless
