#include "mesh_check_before.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <vector>

#include "text_words.h"

namespace meshless {
namespace {

bool isBinaryStl(std::string_view text) {
  std::uint32_t faces = 0;
  if (text.size() < 84) return false;
  std::memcpy(&faces, text.data() + 80, sizeof faces);
  return 84 + 50ull * faces == text.size();
}

Result<PromisedCounts> checkStl(const std::string& name, std::string_view text) {
  const std::uint64_t bytes = text.size();
  const bool whole_header = bytes >= 84;
  std::uint32_t faces = 0;
  if (whole_header) std::memcpy(&faces, text.data() + 80, sizeof faces);
  if (isBinaryStl(text)) {
    if (faces == 0) return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no triangles"};
    if (Status status = checkCounts(name, 3.0 * faces / 4.0, faces, 0.0); !status) return status.error();
    return PromisedCounts{};
  }
  if (text.substr(0, 5) != "solid") {
    if (!whole_header) return unreadable(name, "is no STL file, or truncated");
    std::ostringstream what;
    what << "promises " << faces << " triangles and is " << (84 + 50ull * faces > bytes ? "truncated" : "longer");
    return unreadable(name, what.str());
  }
  // Text; its end is a line "endsolid NAME".
  const std::string_view tail = text.substr(bytes - std::min<std::size_t>(bytes, kMaxHeader));
  if (lowerCase(tail).find("endsolid") == std::string::npos)
    return unreadable(name, "is truncated: it has no endsolid");
  // The reader takes a file with other bytes for a binary one, and makes room for as many triangles as they spell.
  for (std::size_t at = 0; at < text.size(); ++at) {
    const auto c = static_cast<unsigned char>(text[at]);
    if (c > 126 || (c < 32 && c != '\n' && c != '\r' && c != '\t'))
      return unreadable(name, "begins as text and has the byte " + std::to_string(c) + " at " + std::to_string(at));
  }
  return PromisedCounts{};
}

/// Whether an OBJ line ends in a backslash.
bool continues(std::string_view line) {
  while (!line.empty() && isBlank(line.back())) line.remove_suffix(1);
  return !line.empty() && line.back() == '\\';
}

/// The texture coordinates of an OBJ file, as its lines come.
class ObjTexture {
 public:
  explicit ObjTexture(FileTexture& to) : to_(to) {}

  void addPoint(const std::vector<std::string>& vt) {
    std::array<double, 2> at{};
    for (std::size_t k = 1; k < std::min<std::size_t>(vt.size(), 3); ++k)
      at[k - 1] = numberOf(vt[k]).value_or(std::nan(""));
    points_.push_back({static_cast<float>(at[0]), static_cast<float>(at[1])});
  }
  /// `number`: what follows the vertex of a face's corner, as in 7/5/3.
  void addCorner(const char* number, std::size_t line) {
    long long point = *number == '/' ? std::strtoll(number + 1, nullptr, 10) : 0;  // 0 where there is none
    if (point < 0) point += static_cast<long long>(points_.size()) + 1;
    if (point > 0)
      corners_.push_back(static_cast<Index>(std::min(point, static_cast<long long>(kNoIndex))));
    else if (without_ == 0)
      without_ = line;
  }
  void finish() {
    if (corners_.empty()) return;
    if (without_ > 0) to_.fault = "a corner of the face in line " + std::to_string(without_) + " has none";
    for (const Index number : corners_) {
      if (number > points_.size() && to_.fault.empty())
        to_.fault = "a corner of a face has the number " + std::to_string(number) + "; accepted: 1 to " +
                    std::to_string(points_.size()) + ", the number of vt lines";
      if (!to_.fault.empty()) return to_.corners.clear();
      to_.corners.push_back(points_[number - 1]);
    }
  }

 private:
  FileTexture& to_;
  std::vector<TexturePoint> points_;
  std::vector<Index> corners_;  // numbers from 1 on
  std::size_t without_ = 0;     // the first line with a corner that has none
};

}  // namespace

Status checkCounts(const std::string& name, double points, double faces, double corners) {
  if (!(points >= 1.0)) return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no points"};
  const auto tooMany = [&](double n, const char* of, std::size_t most) {
    std::ostringstream text;
    text.precision(15);
    text << "'" << name << "' has " << n << " " << of << "; accepted: up to " << most;
    return Error{ErrorCode::kUnsuitableShape, text.str()};
  };
  if (!(points <= static_cast<double>(kMaxPoints))) return tooMany(points, "points", kMaxPoints);
  if (!(faces <= static_cast<double>(kMaxFaces))) return tooMany(faces, "faces", kMaxFaces);
  if (!(corners <= static_cast<double>(kMaxCorners))) return tooMany(corners, "corners of faces", kMaxCorners);
  return Done{};
}

Result<MeshFormat> meshFormatOf(const std::string& name) {
  const std::string ending = lowerCase(std::filesystem::path(name).extension().string());
  if (ending == ".pcd") return MeshFormat::kPcd;
  if (ending == ".ply") return MeshFormat::kPly;
  if (ending == ".obj") return MeshFormat::kObj;
  if (ending == ".stl") return MeshFormat::kStl;
  if (ending == ".vtk") return MeshFormat::kVtk;
  if (ending == ".off") return MeshFormat::kOff;
  if (ending == ".vtu") return MeshFormat::kVtu;
  if (ending == ".msh") return MeshFormat::kMsh;
  return unreadable(name, "is of an unknown kind; accepted endings: .pcd, .ply, .obj, .stl, .vtk, .off, .vtu, .msh");
}

Result<PromisedCounts> checkBeforeReading(const std::string& name, std::string_view text, MeshFormat format) {
  if (text.empty()) return unreadable(name, "is empty");
  switch (format) {
    case MeshFormat::kStl:
      return checkStl(name, text);
    case MeshFormat::kPcd:  // for these, what makes them plain looks at every number
    case MeshFormat::kVtk:
    case MeshFormat::kObj:
    case MeshFormat::kOff:
    case MeshFormat::kPly:
    case MeshFormat::kVtu:
    case MeshFormat::kMsh:
      break;
  }
  return PromisedCounts{};
}

std::string plainStl(std::string_view text) {
  if (isBinaryStl(text) || lowerCase(text.substr(0, 5)) != "solid") return "";
  const bool lower = text.substr(0, 5) == "solid";
  if (lower && std::all_of(text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 127; }))
    return "";
  std::string plain;
  for (std::string_view line; nextLine(text, line);) {
    std::string_view rest = line.substr(0, 60);
    const std::string word = lowerCase(nextWord(rest));
    plain += word == "solid" || word == "endsolid" ? word : lowerCase(line);
    plain += '\n';
  }
  return plain;
}

Result<std::string> plainObj(const std::string& name, std::string_view text, FileTexture& texture) {
  // Some programs write their whole buffer. More of them are a hole in a file, and no text.
  const std::size_t end = text.find_last_not_of('\0') + 1;  // 0: nothing else
  constexpr std::size_t kMostNuls = 65536;
  if (text.size() - end <= kMostNuls) text = text.substr(0, end);
  if (const std::string fault = notText(text); !fault.empty()) return unreadable(name, fault);
  std::string plain;
  std::size_t points = 0, faces = 0, corners = 0, line_number = 0;
  const auto bad = [&](const std::string& what) {
    return unreadable(name, "line " + std::to_string(line_number) + ": " + what);
  };
  std::string joined;
  ObjTexture texture_lines(texture);
  for (std::string_view line; nextLine(text, line);) {
    ++line_number;
    if (line.size() > kMaxLine) return bad("is longer than 65536 characters");
    const std::size_t first = line.find_first_not_of(" \t");
    if (first == std::string_view::npos || (line[first] != 'v' && line[first] != 'f')) continue;
    if (continues(line)) {  // only here: a comment may end in the path of a folder
      joined.clear();
      bool more = true;
      while (more && continues(line) && joined.size() <= kMaxLine) {
        joined.append(line.substr(0, line.rfind('\\'))) += ' ';
        more = nextLine(text, line);
        line_number += more;
      }
      if (more) joined.append(line.substr(0, kMaxLine + 1));
      if (joined.size() > kMaxLine) return bad("is longer than 65536 characters");
      line = joined;
    }
    const std::vector<std::string> w = wordsOf(line);
    if (w[0] == "v") {
      if (w.size() < 4) return bad("a vertex needs three numbers, it has " + std::to_string(w.size() - 1));
      plain += "v";
      for (std::size_t k = 1; k < 4; ++k) {
        const std::optional<double> x = numberOf(w[k]);
        if (!x) return bad("'" + w[k].substr(0, 30) + "' is no number");
        // What float cannot hold becomes NaN, for the check of the mesh to name.
        char number[32] = "nan";
        if (std::abs(*x) <= 3.4e38) std::snprintf(number, sizeof number, "%.9g", std::abs(*x) < 1e-37 ? 0.0 : *x);
        plain += " ";
        plain += number;
      }
      plain += "\n";
      ++points;
    } else if (w[0] == "f") {
      if (w.size() < 4) return bad("a face needs three corners, it has " + std::to_string(w.size() - 1));
      if (w.size() > kMaxPolygon + 1) return bad("a face has more than 1000 corners");
      plain += "f";
      for (std::size_t k = 1; k < w.size(); ++k) {
        char* end = nullptr;
        errno = 0;
        const long long corner = std::strtoll(w[k].c_str(), &end, 10);
        if (end == w[k].c_str() || (*end != '\0' && *end != '/') || errno != 0)
          return bad("'" + w[k].substr(0, 30) + "' is no vertex number");
        // Relative numbers become absolute ones; one that names no vertex becomes 0, for the check of the mesh to name.
        long long absolute = corner < 0 ? static_cast<long long>(points) + 1 + corner : corner;
        if (absolute < 0 || absolute > static_cast<long long>(kMaxPoints)) absolute = 0;
        plain += " " + std::to_string(absolute);
        texture_lines.addCorner(end, line_number);
      }
      plain += "\n";
      ++faces;
      corners += w.size() - 1;
    } else {
      if (w[0] == "vt") texture_lines.addPoint(w);
      continue;
    }
    if (points > kMaxPoints || faces > kMaxFaces || corners > kMaxCorners) break;
  }
  if (Status status =
          checkCounts(name, static_cast<double>(points), static_cast<double>(faces), static_cast<double>(corners));
      !status)
    return status.error();
  texture_lines.finish();
  return plain;
}

}  // namespace meshless
