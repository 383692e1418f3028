#include "mesh_check_before.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

namespace meshless {
namespace {

constexpr std::uintmax_t kMaxBytes = 512ull << 20;
constexpr std::size_t kMaxPoints = 2000000;
constexpr std::size_t kMaxHeader = 1 << 16;  // bytes
constexpr std::size_t kMaxPolygon = 1000;    // corners

std::string fileName(const std::string& path) { return std::filesystem::path(path).filename().string(); }

Error unreadable(const std::string& path, const std::string& what) {
  return {ErrorCode::kUnreadable, "'" + fileName(path) + "' " + what};
}

Status checkPoints(const std::string& path, double points) {
  if (!(points >= 1.0)) return Error{ErrorCode::kUnsuitableShape, "'" + fileName(path) + "' has no points"};
  if (!(points <= kMaxPoints)) {
    std::ostringstream text;
    text << "'" << fileName(path) << "' has " << points << " points; accepted: up to 2000000";
    return Error{ErrorCode::kUnsuitableShape, text.str()};
  }
  return Done{};
}

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// For a message.
std::string printable(std::string text) {
  text = text.substr(0, 60);
  for (char& c : text)
    if (!std::isprint(static_cast<unsigned char>(c))) c = '?';
  return text;
}

/// The start of the file, as far as a header may reach.
std::string headOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string head(kMaxHeader, '\0');
  in.read(&head[0], static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(std::max<std::streamsize>(0, in.gcount())));
  return head;
}

std::vector<std::string> words(const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> all;
  for (std::string word; in >> word;) all.push_back(word);
  return all;
}

/// A whole number >= 0 as a double, so that no count overflows; NaN where it is none.
double count(const std::string& word) {
  if (word.empty() || !std::all_of(word.begin(), word.end(), [](unsigned char c) { return std::isdigit(c); }))
    return std::nan("");
  return std::strtod(word.c_str(), nullptr);
}

Result<PromisedCounts> checkPly(const std::string& path, std::uintmax_t bytes) {
  const std::string text = headOf(path);
  if (text.compare(0, 3, "ply") != 0) return unreadable(path, "is no PLY file: it does not begin with 'ply'");
  std::istringstream head(text);
  double points = std::nan(""), faces = 0.0, properties = 0.0;
  bool ended = false;
  std::string element;
  std::vector<std::string> names;  // of the element's properties
  // PCL aborts the process on lists where it expects none: the header must be one that it knows.
  const auto isType = [](const std::string& word) {
    for (const char* type : {"char", "uchar", "short", "ushort", "int", "uint", "float", "double", "int8", "uint8",
                             "int16", "uint16", "int32", "uint32", "float32", "float64"})
      if (word == type) return true;
    return false;
  };
  const auto isWhole = [&](const std::string& word) {
    return isType(word) && word.compare(0, 5, "float") != 0 && word != "double";
  };
  for (std::string line; !ended && std::getline(head, line);) {
    const std::vector<std::string> w = words(line);
    const auto bad = [&] { return unreadable(path, "has a damaged header: '" + printable(line) + "'"); };
    if (w.empty()) continue;
    if (w[0] == "comment" || w[0] == "obj_info" || w[0] == "ply" || w[0] == "format") continue;
    if (w[0] == "end_header") {
      ended = true;
    } else if (w[0] == "property" && w.size() == 3) {
      // A coordinate of a whole-number type is one that no cloud has room for.
      const bool coordinate = element == "vertex" && (w[2] == "x" || w[2] == "y" || w[2] == "z");
      if (element.empty() || !isType(w[1]) || (coordinate && isWhole(w[1]))) return bad();
      if (std::find(names.begin(), names.end(), w[2]) != names.end()) return bad();
      names.push_back(w[2]);
      properties += 1.0;
    } else if (w[0] == "property" && w.size() == 5 && w[1] == "list") {
      const bool corners = w[4] == "vertex_indices" || w[4] == "vertex_index";
      if (element != "face" || !corners || !isWhole(w[2]) || !isWhole(w[3]) || !names.empty()) return bad();
      names.push_back(w[4]);
    } else if (w[0] == "element" && w.size() == 3) {
      const double n = count(w[2]);
      // No element is shorter than a byte.
      if (!(n <= static_cast<double>(bytes)))
        return unreadable(path, "promises " + printable(w[2]) + " of " + printable(w[1]) + " and is truncated");
      element = w[1];
      names.clear();
      if (element == "camera" && n == 1.0) continue;  // PCL's own files have it
      if (element != "vertex" && element != "face")
        return unreadable(path, "has the element '" + printable(element) + "'; accepted: vertex, face");
      if (element == "vertex" ? !std::isnan(points) || faces > 0.0 : std::isnan(points)) return bad();
      (element == "vertex" ? points : faces) = n;
    } else {
      return bad();
    }
  }
  if (!ended) return unreadable(path, "has a truncated header: it has no end_header");
  if (std::isnan(points)) points = 0.0;
  if (Status status = checkPoints(path, points); !status) return status.error();
  if (!(8.0 * properties * points <= static_cast<double>(kMaxBytes)))
    return unreadable(path, "has properties that need more than 512 MiB");
  PromisedCounts promised;
  promised.points = static_cast<std::size_t>(points);
  promised.faces = static_cast<std::size_t>(faces);
  return promised;
}

Result<PromisedCounts> checkStl(const std::string& path, std::uintmax_t bytes) {
  std::ifstream in(path, std::ios::binary);
  std::array<char, 84> head{};
  in.read(head.data(), head.size());
  const bool whole_header = in.gcount() == static_cast<std::streamsize>(head.size());
  std::uint32_t faces = 0;
  std::memcpy(&faces, head.data() + 80, sizeof faces);
  if (whole_header && 84 + 50ull * faces == bytes) {
    if (faces == 0) return Error{ErrorCode::kUnsuitableShape, "'" + fileName(path) + "' has no triangles"};
    if (Status status = checkPoints(path, 3.0 * faces / 4.0); !status) return status.error();
    return PromisedCounts{};
  }
  if (std::strncmp(head.data(), "solid", 5) != 0) {
    if (!whole_header) return unreadable(path, "is no STL file, or truncated");
    std::ostringstream what;
    what << "promises " << faces << " triangles and is " << (84 + 50ull * faces > bytes ? "truncated" : "longer");
    return unreadable(path, what.str());
  }
  // Text; its end is a line "endsolid NAME".
  in.clear();
  const std::uintmax_t tail = std::min<std::uintmax_t>(bytes, kMaxHeader);
  in.seekg(static_cast<std::streamoff>(bytes - tail));
  std::string end(static_cast<std::size_t>(tail), '\0');
  in.read(&end[0], static_cast<std::streamsize>(tail));
  if (lower(end).find("endsolid") == std::string::npos) return unreadable(path, "is truncated: it has no endsolid");
  // The reader takes a file with other bytes for a binary one, and makes room for as many triangles as they spell.
  in.clear();
  in.seekg(0);
  std::string block(kMaxHeader, '\0');
  for (std::uintmax_t at = 0; at < bytes; at += block.size()) {
    in.read(&block[0], static_cast<std::streamsize>(block.size()));
    const auto read = static_cast<std::size_t>(std::max<std::streamsize>(0, in.gcount()));
    for (std::size_t i = 0; i < read; ++i) {
      const auto c = static_cast<unsigned char>(block[i]);
      if (c > 126 || (c < 32 && c != '\n' && c != '\r' && c != '\t'))
        return unreadable(path,
                          "begins as text and has the byte " + std::to_string(c) + " at " + std::to_string(at + i));
    }
  }
  return PromisedCounts{};
}

}  // namespace

Result<MeshFormat> meshFormatOf(const std::string& path) {
  const std::string ending = lower(std::filesystem::path(path).extension().string());
  if (ending == ".pcd") return MeshFormat::kPcd;
  if (ending == ".ply") return MeshFormat::kPly;
  if (ending == ".obj") return MeshFormat::kObj;
  if (ending == ".stl") return MeshFormat::kStl;
  if (ending == ".vtk") return MeshFormat::kVtk;
  return unreadable(path, "is of an unknown kind; accepted endings: .pcd, .ply, .obj, .stl, .vtk");
}

Result<PromisedCounts> checkBeforeReading(const std::string& path, MeshFormat format) {
  std::error_code failed;
  if (!std::filesystem::is_regular_file(path, failed)) return unreadable(path, "is missing");
  const std::uintmax_t bytes = std::filesystem::file_size(path, failed);
  if (failed || !std::ifstream(path)) return unreadable(path, "cannot be opened");
  if (bytes == 0) return unreadable(path, "is empty");
  if (bytes > kMaxBytes)
    return unreadable(path, "has " + std::to_string(bytes) + " bytes; accepted: up to 536870912 (512 MiB)");
  switch (format) {
    case MeshFormat::kPly:
      return checkPly(path, bytes);
    case MeshFormat::kStl:
      return checkStl(path, bytes);
    case MeshFormat::kPcd:  // for these, what makes them plain looks at every number
    case MeshFormat::kVtk:
    case MeshFormat::kObj:
      break;
  }
  return PromisedCounts{};
}

Result<std::string> plainObj(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) return unreadable(path, "cannot be opened");
  std::string plain;
  std::size_t points = 0, line_number = 0;
  const auto bad = [&](const std::string& what) {
    return unreadable(path, "line " + std::to_string(line_number) + ": " + what);
  };
  for (std::string line; std::getline(in, line);) {
    ++line_number;
    if (line.size() > 1 << 16) return bad("is longer than 65536 characters");
    const char first = line.find_first_not_of(" \t") == std::string::npos ? '\0' : line[line.find_first_not_of(" \t")];
    if (first != 'v' && first != 'f') continue;
    const std::vector<std::string> w = words(line);
    if (w[0] == "v") {
      if (w.size() < 4) return bad("a vertex needs three numbers, it has " + std::to_string(w.size() - 1));
      plain += "v";
      for (std::size_t k = 1; k < 4; ++k) {
        char* end = nullptr;
        const double x = std::strtod(w[k].c_str(), &end);
        if (*end != '\0') return bad("'" + w[k].substr(0, 30) + "' is no number");
        // What float cannot hold becomes NaN, for the check of the mesh to name.
        char number[32] = "nan";
        if (std::abs(x) <= 3.4e38) std::snprintf(number, sizeof number, "%.9g", std::abs(x) < 1e-37 ? 0.0 : x);
        plain += " ";
        plain += number;
      }
      plain += "\n";
      if (++points > kMaxPoints) return checkPoints(path, static_cast<double>(points)).error();
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
      }
      plain += "\n";
    }
  }
  if (points == 0) return Error{ErrorCode::kUnsuitableShape, "'" + fileName(path) + "' has no points"};
  return plain;
}

}  // namespace meshless
