#include "meshless_surgery/geometry/lattice/cut_lattice.h"

#include <algorithm>
#include <map>

#include "meshless_surgery/geometry/query/union_find.h"

namespace meshless {
namespace {

constexpr double kOnPlane = 1e-9;  // of the spacing: a layer of corners so close to the plane lies on it

// Samples of the eighth of a cell at a corner.
constexpr SampleSet eighthAt(int corner) {
  SampleSet eighth = kAllSamples;
  for (int axis = 0; axis < 3; ++axis) {
    const int from = corner >> axis & 1 ? 2 : 0;
    eighth &= sampleLayer(axis, from) | sampleLayer(axis, from + 1);
  }
  return eighth;
}
constexpr std::array<SampleSet, 8> kEighths = {eighthAt(0), eighthAt(1), eighthAt(2), eighthAt(3),
                                               eighthAt(4), eighthAt(5), eighthAt(6), eighthAt(7)};

// The part with a sample nearest to the corner; of equally near ones the larger.
Index partAt(const std::vector<LatticeCell>& cells, const std::vector<Index>& parts, int corner) {
  const Vec3 at(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
  Index best = parts[0];
  double least = 1e300;
  for (const Index p : parts) {
    double distance = 1e300;
    for (SampleSet left = cells[p].samples; left; left &= left - 1)
      distance = std::min(distance, (samplePlace(lowestSample(left)) - at).squaredNorm());
    if (distance < least || (distance == least && countSamples(cells[p].samples) > countSamples(cells[best].samples))) {
      least = distance;
      best = p;
    }
  }
  return best;
}

class Cutter {
 public:
  Cutter(const CellLattice& lattice, const Points& corners, const Blade& blade)
      : before_(lattice), x_(corners), blade_(blade) {}

  CutLattice run() {
    findSides();
    findFamilies();
    cutInside();
    cutFaces();
    makeParts();
    joinCorners();
    return std::move(result_);
  }

 private:
  // The copies of a lattice cell that a blade has not parted altogether: one cell, or a bridge and the parts it joins.
  struct Family {
    Index whole;               // has all samples
    std::vector<Index> parts;  // the cell itself where nothing bridges
    LinkSet parted;
    LinkSet tip{};  // links across the plane, of a family that the blade has met
    bool inside_cut = false, face_cut = false;
    int face = -1;                                            // axis of the upper face that its bridge holds
    SampleSet face_links = kNoSample, face_left = kNoSample;  // all there were of it, and those that the blade leaves
    bool isBridged() const { return parts[0] != whole; }
  };

  const LatticeCell& cellOf(const Family& f) const { return before_.cells[f.whole]; }

  Vec3 positionOf(const LatticeCell& cell, int bit) const {
    const Vec3 at = samplePlace(bit);
    Vec3 p = Vec3::Zero();
    for (int k = 0; k < 8; ++k) p += trilinearWeight(k, at) * x_[cell.corners[k]];
    return p;
  }

  void findSides() {
    std::vector<double> heights(x_.size());
    for (std::size_t i = 0; i < x_.size(); ++i) heights[i] = blade_.height(x_[i]);
    const double on = kOnPlane * before_.spacing;
    static const std::vector<std::array<double, 8>> kWeights = [] {
      std::vector<std::array<double, 8>> weights(64);
      for (int bit = 0; bit < 64; ++bit)
        for (int k = 0; k < 8; ++k) weights[bit][k] = trilinearWeight(k, samplePlace(bit));
      return weights;
    }();
    near_.resize(before_.cells.size());
    above_.resize(before_.cells.size());
    for (Index c = 0; c < before_.cells.size(); ++c) {
      std::array<double, 8> h;
      for (int k = 0; k < 8; ++k) h[k] = heights[before_.cells[c].corners[k]];
      near_[c] = *std::min_element(h.begin(), h.end()) <= on && *std::max_element(h.begin(), h.end()) >= -on;
      if (!near_[c]) {
        above_[c] = h[0] >= 0.0 ? kAllSamples : kNoSample;
        continue;
      }
      SampleSet above = kNoSample;
      for (int bit = 0; bit < 64; ++bit) {
        double sum = 0.0;
        for (int k = 0; k < 8; ++k) sum += kWeights[bit][k] * h[k];
        if (sum >= 0.0) above |= SampleSet{1} << bit;
      }
      above_[c] = above;
    }
  }

  void findFamilies() {
    family_of_.assign(before_.cells.size(), kNoIndex);
    for (Index c = 0; c < before_.cells.size(); ++c) {
      const Index bridge = before_.cells[c].bridge;
      if (bridge != kNoIndex && bridge != c) continue;
      family_of_[c] = static_cast<Index>(families_.size());
      families_.push_back({c, {}, before_.cells[c].parted});
      families_.back().face = before_.cells[c].face;
    }
    for (Index c = 0; c < before_.cells.size(); ++c) {
      const Index bridge = before_.cells[c].bridge;
      if (bridge == c) continue;
      if (bridge != kNoIndex) family_of_[c] = family_of_[bridge];
      families_[family_of_[c]].parts.push_back(c);
    }
  }

  // Of the links in `crossing` of samples of `lower` along an axis, to samples of `upper`: those through the blade.
  SampleSet throughBlade(SampleSet crossing, const LatticeCell& lower, SampleSet lower_above, const LatticeCell& upper,
                         SampleSet upper_above, int axis, bool across) const {
    if (!blade_.bounded()) return crossing;
    SampleSet through = kNoSample;
    for (SampleSet left = crossing; left; left &= left - 1) {
      const int bit = lowestSample(left);
      const int other = across ? bit - (kCellSamples - 1) * kSampleStride[axis] : bit + kSampleStride[axis];
      if (blade_.passes(positionOf(lower, bit), lower_above >> bit & 1 ? 1 : -1, positionOf(upper, other),
                        upper_above >> other & 1 ? 1 : -1))
        through |= SampleSet{1} << bit;
    }
    return through;
  }

  // The side of each sample by the part that it is in: parts may have moved apart.
  SampleSet aboveOf(const Family& f) const {
    if (f.parts.size() == 1) return above_[f.parts[0]];
    SampleSet above = kNoSample;
    for (const Index p : f.parts) above |= above_[p] & before_.cells[p].samples;
    return above;
  }

  void cutInside() {
    for (Family& f : families_) {
      if (std::none_of(f.parts.begin(), f.parts.end(), [&](Index p) { return near_[p]; })) continue;
      const LatticeCell& cell = cellOf(f);
      const SampleSet above = aboveOf(f);
      for (int axis = 0; axis < 3; ++axis) {
        const int stride = kSampleStride[axis];
        const SampleSet crossing =
            cell.samples & (cell.samples >> stride) & ~kUpperLayer[axis] & (above ^ (above >> stride));
        f.tip[axis] = crossing;
        const SampleSet cut = throughBlade(crossing & ~f.parted[axis], cell, above, cell, above, axis, false);
        f.parted[axis] |= cut;
        f.inside_cut = f.inside_cut || cut;
      }
    }
  }

  void cutFaces() {
    const CornerUses uses = cornerUses(before_);
    for (Index f = 0; f < families_.size(); ++f)
      for (int axis = 0; axis < 3; ++axis)
        for (const Index p : families_[f].parts) {
          const LatticeCell& part = before_.cells[p];
          // Across a face that a bridge holds, the bridge alone has the corners.
          const bool held = families_[f].face == axis;
          const Index corner = (held ? cellOf(families_[f]) : part).corners[1u << axis];
          for (Index u = uses.offsets[corner]; u < uses.offsets[corner + 1]; ++u) {
            const Index q = uses.cells[u];
            if (before_.cells[q].isBridge(q) || !(near_[p] || near_[q])) continue;
            bool next = true;
            for (int k = 0; k < 3; ++k) next = next && before_.cells[q].place[k] == part.place[k] + (k == axis);
            if (next) cutFace(families_[f], p, families_[family_of_[q]], q, axis);
          }
        }
  }

  void cutFace(Family& lower, Index p, Family& upper, Index q, int axis) {
    const LatticeCell &a = before_.cells[p], &b = before_.cells[q];
    const int across = (kCellSamples - 1) * kSampleStride[axis];
    const SampleSet crossing = faceLinks(a.samples, b.samples, axis) & ~lower.parted[axis] &
                               (above_[p] ^ ((above_[q] & kLowerLayer[axis]) << across));
    if (!crossing) return;
    SampleSet cut = throughBlade(crossing, a, above_[p], b, above_[q], axis, true);
    const bool plane_in_face =
        !(lower.tip[0] | lower.tip[1] | lower.tip[2] | upper.tip[0] | upper.tip[1] | upper.tip[2]);
    if (lower.inside_cut && upper.inside_cut) {
      cut = crossing;  // both are parted altogether, and bridged
    } else if (plane_in_face && lower.face < 0 && cut && cut != crossing) {
      if (lower.isBridged())
        cut = 2 * countSamples(cut) >= countSamples(crossing) ? crossing : kNoSample;
      else
        lower.face = axis;
    }
    if (!cut) return;
    lower.parted[axis] |= cut;
    if (lower.face == axis) {
      lower.face_links = faceLinks(a.samples, b.samples, axis);
      lower.face_left = lower.face_links & ~lower.parted[axis];
    }
    lower.face_cut = upper.face_cut = true;
  }

  void add(LatticeCell cell, Index parent, bool changed) {
    cell.resists = resistanceOf(before_.cells[parent], cell.filled);
    result_.lattice.cells.push_back(cell);
    result_.parent_cell.push_back(parent);
    result_.changed.push_back(changed);
    result_.above.push_back(above_[parent]);
  }

  void makeParts() {
    result_.lattice.spacing = before_.spacing;
    result_.lattice.origin = before_.origin;
    result_.lattice.regions = before_.regions;
    for (const Family& f : families_) {
      const bool changed = f.inside_cut || f.face_cut;
      SampleSet left = cellOf(f).samples;
      if (!f.inside_cut || !left) {
        if (f.face >= 0 && f.face_links) {
          addOverFace(f);
          continue;
        }
        const Index first = static_cast<Index>(result_.lattice.cells.size());
        const Index bridge = f.isBridged() ? first + static_cast<Index>(f.parts.size()) : kNoIndex;
        for (const Index p : f.parts) {
          LatticeCell cell = before_.cells[p];
          cell.parted = f.parted;
          cell.bridge = bridge;
          add(cell, p, changed);
        }
        if (bridge != kNoIndex) {
          LatticeCell cell = cellOf(f);
          cell.parted = f.parted;
          cell.bridge = bridge;
          add(cell, f.whole, changed);
        }
        continue;
      }
      LinkSet altogether = f.parted;
      for (int axis = 0; axis < 3; ++axis) altogether[axis] |= f.tip[axis];
      while (left) {
        const SampleSet whole = connectedPart(left, f.parted);
        left &= ~whole;
        addWhole(f, whole, altogether);
      }
    }
  }

  // A cell whose upper face the blade has parted as far as it reaches: it and the bridge that holds the rest.
  void addOverFace(const Family& f) {
    LatticeCell cell = before_.cells[f.parts[0]];
    const double share = cell.stiffness_share + (f.isBridged() ? cellOf(f).stiffness_share : 0.0);
    const double left = static_cast<double>(countSamples(f.face_left)) / countSamples(f.face_links);
    cell.parted = f.parted;
    cell.face = left > 0.0 ? f.face : -1;
    cell.bridge = left > 0.0 ? static_cast<Index>(result_.lattice.cells.size()) + 1 : kNoIndex;
    cell.stiffness_share = share * (1.0 - left * left);
    add(cell, f.parts[0], true);
    if (!(left > 0.0)) return;
    cell.corners = cellOf(f).corners;
    cell.mass_share = 0.0;
    cell.stiffness_share = share * left * left;
    add(cell, f.whole, true);
  }

  // What hangs together of a family: one cell, or its parts across the plane and their bridge.
  void addWhole(const Family& f, SampleSet whole, const LinkSet& altogether) {
    std::vector<SampleSet> parts;
    std::vector<Index> parents;
    for (const Index p : f.parts) {
      SampleSet mine = before_.cells[p].samples & whole;
      while (mine) {
        parts.push_back(connectedPart(mine, altogether));
        parents.push_back(p);
        mine &= ~parts.back();
      }
    }
    int links = 0, cut = 0;
    for (const SampleSet part : parts)
      for (int axis = 0; axis < 3; ++axis) {
        const SampleSet beyond = (whole & ~part) >> kSampleStride[axis] & ~kUpperLayer[axis];
        const SampleSet before = whole & ~part & ~kUpperLayer[axis];
        links += countSamples(part & beyond) + countSamples(before & (part >> kSampleStride[axis]));
        cut += countSamples(part & beyond & f.parted[axis]) +
               countSamples(before & (part >> kSampleStride[axis]) & f.parted[axis]);
      }
    LatticeCell cell = cellOf(f);
    cell.parted = f.parted;
    cell.bridge = kNoIndex;
    cell.face = -1;
    const bool one_parent = std::all_of(parents.begin(), parents.end(), [&](Index p) { return p == parents[0]; });
    if (one_parent && cut == 0) {
      cell.corners = before_.cells[parents[0]].corners;
      cell.samples = cell.filled = whole;
      cell.mass_share = cell.stiffness_share = before_.cells[parents[0]].mass_share;
      return add(cell, parents[0], true);
    }
    const double held = 1.0 - static_cast<double>(std::max(cut, 1)) / links;
    cell.bridge = static_cast<Index>(result_.lattice.cells.size() + parts.size());
    double of_all = 0.0;
    for (std::size_t n = 0; n < parts.size(); ++n) {
      cell.corners = before_.cells[parents[n]].corners;
      cell.samples = cell.filled = parts[n];
      cell.mass_share = before_.cells[parents[n]].mass_share;  // crumbs may have taken of one part and not of another
      cell.stiffness_share = cell.mass_share * (1.0 - held * held);
      of_all += cell.mass_share * countSamples(parts[n]) / countSamples(whole);
      add(cell, parents[n], true);
    }
    cell.corners = cellOf(f).corners;
    cell.samples = cell.filled = whole;
    cell.mass_share = 0.0;
    cell.stiffness_share = of_all * held * held;
    add(cell, f.whole, true);
  }

  // Which side of the plane most of a cell is on.
  int sideOf(Index c) const {
    const LatticeCell& cell = result_.lattice.cells[c];
    if (!cell.samples) {
      double sum = 0.0;
      for (const Index corner : before_.cells[result_.parent_cell[c]].corners) sum += blade_.height(x_[corner]);
      return sum >= 0.0 ? 1 : -1;
    }
    return 2 * countSamples(cell.samples & result_.above[c]) >= countSamples(cell.samples) ? 1 : -1;
  }

  // At a corner of the parent: the copies of a and b there are the same.
  bool joined(Index a, Index b) const {
    const LatticeCell &ca = result_.lattice.cells[a], &cb = result_.lattice.cells[b];
    if (!ca.samples || !cb.samples) {  // a crumb goes with what is on its side
      const bool bounded = blade_.bounded() && !(result_.changed[a] && result_.changed[b]);
      return bounded || sideOf(a) == sideOf(b);
    }
    int axis = -1;
    for (int k = 0; k < 3; ++k) {
      const int step = cb.place[k] - ca.place[k];
      if (step == 0) continue;
      if (axis >= 0 || (step != 1 && step != -1)) return false;
      axis = k;
    }
    if (axis < 0) return false;
    const bool up = cb.place[axis] > ca.place[axis];
    const LatticeCell &lower = up ? ca : cb, &upper = up ? cb : ca;
    return lower.face != axis && (faceLinks(lower.samples, upper.samples, axis) & ~lower.parted[axis]);
  }

  // The corner of a cell that each corner of a bridge is, 8 c + k: of the parts that it joins, or of the cell across
  // the face that it holds.
  std::vector<std::array<Index, 8>> bridgedCorners() const {
    const std::vector<LatticeCell>& cells = result_.lattice.cells;
    std::vector<std::vector<Index>> parts(cells.size());
    std::map<std::array<Index, 2>, std::vector<Index>> users;  // by the corner that it was, and which of the cell's
    std::vector<bool> wanted(before_.corners, false);
    for (Index c = 0; c < cells.size(); ++c) {
      if (cells[c].isBridge(c))
        for (const Index corner : cells[c].corners) wanted[corner] = true;
      if (cells[c].bridge != kNoIndex && !cells[c].isBridge(c)) parts[cells[c].bridge].push_back(c);
    }
    std::vector<std::array<Index, 8>> found(cells.size());
    for (Index c = 0; c < cells.size(); ++c)
      if (!cells[c].isBridge(c))
        for (Index k = 0; k < 8; ++k)
          if (wanted[cells[c].corners[k]]) users[{cells[c].corners[k], k}].push_back(c);
    for (Index c = 0; c < cells.size(); ++c) {
      if (!cells[c].isBridge(c)) continue;
      for (Index k = 0; k < 8; ++k) {
        const Index was = cells[c].corners[k];
        std::vector<Index> same;
        for (const Index p : parts[c])
          if (cells[p].corners[k] == was) same.push_back(p);
        found[c][k] = 8 * partAt(cells, same.empty() ? parts[c] : same, static_cast<int>(k)) + k;
        const int axis = cells[c].face;
        if (axis < 0 || !(k >> axis & 1)) continue;
        const auto across = users.find({was, k ^ 1u << axis});
        if (across == users.end()) continue;
        int most = -1;  // links that hold; a blade leaves a copy of that cell on either side
        for (const Index q : across->second) {
          if (!isAcross(cells[c], cells[q], axis)) continue;
          const int holds = countSamples(faceLinks(cells[c].samples, cells[q].samples, axis) & ~cells[c].parted[axis]);
          if (holds <= most) continue;
          most = holds;
          found[c][k] = 8 * q + (k ^ 1u << axis);
        }
      }
    }
    return found;
  }

  static bool isAcross(const LatticeCell& lower, const LatticeCell& upper, int axis) {
    std::array<std::int32_t, 3> place = lower.place;
    ++place[axis];
    return upper.place == place;
  }

  Vec3 middleOf(Index c) const {
    const LatticeCell &cell = result_.lattice.cells[c], &was = before_.cells[result_.parent_cell[c]];
    Vec3 sum = Vec3::Zero();
    for (SampleSet left = cell.samples; left; left &= left - 1) sum += positionOf(was, lowestSample(left));
    if (cell.samples) return sum / countSamples(cell.samples);
    for (const Index corner : was.corners) sum += x_[corner] / 8.0;
    return sum;
  }

  // Cells may share a corner that no link passes: a thin part of the surface goes from one to the other. A blade
  // between them parts them there.
  void openBetweenSides(std::vector<bool>& open) const {
    const std::vector<LatticeCell>& cells = result_.lattice.cells;
    std::vector<char> sides(before_.corners, 0);  // of its cells, as bits
    const auto each = [&](const auto& visit) {
      for (Index c = 0; c < cells.size(); ++c) {
        if (cells[c].isBridge(c)) continue;
        const bool above = sideOf(c) > 0;
        for (const Index corner : cells[c].corners) visit(corner, c, above);
      }
    };
    each([&](Index corner, Index, bool above) { sides[corner] |= above ? 2 : 1; });
    std::map<Index, std::array<std::vector<Index>, 2>> on;
    each([&](Index corner, Index c, bool above) {
      if (!open[corner] && sides[corner] == 3) on[corner][above].push_back(c);
    });
    std::map<Index, Vec3> middles;
    const auto middle = [&](Index c) {
      const auto [known, is_new] = middles.try_emplace(c);
      if (is_new) known->second = middleOf(c);
      return known->second;
    };
    for (const auto& [corner, both] : on)
      for (const Index a : both[0])
        for (const Index b : both[1])
          if (!open[corner] && (!blade_.bounded() || blade_.passes(middle(a), -1, middle(b), 1))) open[corner] = true;
  }

  void joinCorners() {
    std::vector<LatticeCell>& cells = result_.lattice.cells;
    // Corners of the parent that a changed cell has are shared out anew; the others stay as they were.
    std::vector<bool> open(before_.corners, false);
    const std::vector<std::array<Index, 8>> held_by = bridgedCorners();
    for (Index c = 0; c < cells.size(); ++c)
      if (result_.changed[c])
        for (const Index corner : cells[c].corners) open[corner] = true;
    openBetweenSides(open);
    std::vector<std::vector<Index>> users(before_.corners);  // nodes, 8 c + k
    for (Index c = 0; c < cells.size(); ++c)
      if (!cells[c].isBridge(c))
        for (Index k = 0; k < 8; ++k)
          if (open[cells[c].corners[k]]) users[cells[c].corners[k]].push_back(8 * c + k);
    UnionFind nodes(8 * cells.size());
    for (const std::vector<Index>& at : users)
      for (std::size_t i = 0; i < at.size(); ++i)
        for (std::size_t j = i + 1; j < at.size(); ++j)
          if (joined(at[i] / 8, at[j] / 8)) nodes.join(at[i], at[j]);
    std::vector<Index> number(8 * cells.size(), kNoIndex), kept(before_.corners, kNoIndex);
    for (Index c = 0; c < cells.size(); ++c) {
      if (cells[c].isBridge(c)) continue;
      for (Index k = 0; k < 8; ++k) {
        const Index old = cells[c].corners[k];
        Index& known = open[old] ? number[nodes.find(8 * c + k)] : kept[old];
        if (known == kNoIndex) {
          known = result_.lattice.corners++;
          result_.parent_corner.push_back(old);
        }
        cells[c].corners[k] = known;
      }
    }
    for (Index c = 0; c < cells.size(); ++c)
      if (cells[c].isBridge(c))
        for (int k = 0; k < 8; ++k) cells[c].corners[k] = cells[held_by[c][k] / 8].corners[held_by[c][k] % 8];
  }

  const CellLattice& before_;
  const Points& x_;
  const Blade& blade_;
  std::vector<bool> near_;
  std::vector<SampleSet> above_;
  std::vector<Family> families_;
  std::vector<Index> family_of_;
  CutLattice result_;
};

}  // namespace

CutLattice cutLattice(const CellLattice& lattice, const Points& corners, const Blade& blade) {
  return Cutter(lattice, corners, blade).run();
}

std::vector<bool> cornersWithTissue(const CellLattice& lattice) {
  std::vector<bool> tissue(lattice.corners, false);
  for (const LatticeCell& cell : lattice.cells)
    for (int k = 0; k < 8; ++k)
      if (cell.samples & kEighths[k]) tissue[cell.corners[k]] = true;
  return tissue;
}

}  // namespace meshless
