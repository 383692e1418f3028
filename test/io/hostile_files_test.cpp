// Files that change while they are read, and files that are larger than they look.
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <functional>
#include <iostream>
#include <map>
#include <thread>

#include "io/temporary_folder.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/io/scene.h"

namespace meshless {
namespace hostile_files_test {

namespace fs = std::filesystem;

const std::vector<std::string> kEndings = {"obj", "ply", "edges.ply", "stl", "pcd", "vtk", "off"};

/// A tetrahedron, or two beside each other: a file of `points` 4 or 8. "edges.ply" has an element that is no shape.
std::string tetrahedra(const std::string& ending, int points) {
  const char* const corners[] = {"0 0 0", "1 0 0", "0 1 0", "0 0 1", "5 0 0", "6 0 0", "5 1 0", "5 0 1"};
  const int faces[8][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}, {4, 6, 5}, {4, 5, 7}, {4, 7, 6}, {5, 6, 7}};
  const auto corner = [&](int k) { return std::string(corners[k]) + "\n"; };
  const std::string n = std::to_string(points);
  std::string text;
  if (ending == "obj") {
    for (int k = 0; k < points; ++k) text += "v " + corner(k);
    for (int k = 0; k < points; ++k)
      text += "f " + std::to_string(faces[k][0] + 1) + " " + std::to_string(faces[k][1] + 1) + " " +
              std::to_string(faces[k][2] + 1) + "\n";
  } else if (ending == "stl") {
    text = "solid s\n";
    for (int k = 0; k < points; ++k) {
      text += "facet normal 0 0 0\nouter loop\n";
      for (int at : faces[k]) text += "vertex " + corner(at);
      text += "endloop\nendfacet\n";
    }
    text += "endsolid s\n";
  } else if (ending == "pcd") {
    text = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " + n + "\nHEIGHT 1\nPOINTS " + n +
           "\nDATA ascii\n";
    for (int k = 0; k < points; ++k) text += corner(k);
  } else {
    const bool edges = ending == "edges.ply";
    if (ending == "vtk")
      text = "# vtk DataFile Version 3.0\ns\nASCII\nDATASET POLYDATA\nPOINTS " + n + " float\n";
    else if (ending == "off")
      text = "OFF\n" + n + " " + n + " 0\n";
    else
      text = "ply\nformat ascii 1.0\nelement vertex " + n + "\nproperty float x\nproperty float y\nproperty float z\n" +
             (edges ? "element edge 1\nproperty int vertex1\nproperty int vertex2\n" : "") + "element face " + n +
             "\nproperty list uchar int vertex_indices\nend_header\n";
    for (int k = 0; k < points; ++k) text += corner(k);
    if (edges) text += "0 1\n";
    if (ending == "vtk") text += "POLYGONS " + n + " " + std::to_string(4 * points) + "\n";
    for (int k = 0; k < points; ++k)
      text += "3 " + std::to_string(faces[k][0]) + " " + std::to_string(faces[k][1]) + " " +
              std::to_string(faces[k][2]) + "\n";
  }
  return text;
}

// --- files that change

/// Calls `swap` over and over beside the test, until it goes out of scope.
class Swapper {
 public:
  explicit Swapper(std::function<void(unsigned)> swap)
      : thread_([this, swap = std::move(swap)] {
          for (unsigned round = 0; !done_; ++round) swap(round);
        }) {}
  ~Swapper() {
    done_ = true;
    thread_.join();
  }

 private:
  std::atomic<bool> done_{false};
  std::thread thread_;
};

struct Swapped : ::testing::Test {
  TemporaryFolder folder;
  FileAccess access;
  int good = 0, refused = 0;

  void SetUp() override {
    fs::create_directories(folder.file("allowed"));
    access.folders = {folder.file("allowed")};
    ::alarm(100);  // whoever waits for a pipe waits for ever
  }
  void TearDown() override {
    ::alarm(0);
    std::cout << good << " times read, " << refused << " times refused\n";
  }

  bool bothSeen() const { return good > 0 && refused > 0; }

  /// So many times, and then until it was read once and refused once.
  void load(const std::string& file, int times) {
    for (int k = 0; k < times || (!bothSeen() && k < 100000); ++k) {
      const Result<std::string> path = access.resolve(file, "/");
      const Result<TriangleMesh> read = path ? readMeshFile(*path) : path.error();
      if (read) {
        ++good;
        // An STL file has each corner of each triangle until equal ones are joined.
        EXPECT_LT(boundsOf(read->vertices).max.x(), 2.0) << file << ": the file outside was read";
      } else {
        ++refused;
        EXPECT_EQ(read.error().detail.find("outside/"), std::string::npos) << read.error().detail;
      }
    }
  }
};

TEST_F(Swapped, ForAPipeOrALinkToAFileOutside) {
  for (const std::string& ending : kEndings) {
    const std::string kept = folder.write("kept." + ending, tetrahedra(ending, 4));
    const std::string outside = folder.write("outside/a." + ending, tetrahedra(ending, 8));
    const std::string file = folder.file("allowed/a." + ending), next = folder.file("allowed/next");
    fs::copy_file(kept, file);
    const Swapper swapper([&](unsigned round) {
      if (round % 3 == 0 && ::link(kept.c_str(), next.c_str()) != 0) return;
      if (round % 3 == 1 && ::mkfifo(next.c_str(), 0600) != 0) return;
      if (round % 3 == 2 && ::symlink(outside.c_str(), next.c_str()) != 0) return;
      ::rename(next.c_str(), file.c_str());
      ::usleep(round % 3 == 0 ? 200 : 20);  // so that it is read whole at times
    });
    load(file, 300);
  }
  EXPECT_TRUE(bothSeen());
}

TEST_F(Swapped, ItsFolderForALinkToOneOutside) {
  for (const std::string& ending : kEndings) {
    folder.write("allowed/kept/a." + ending, tetrahedra(ending, 4));
    folder.write("outside/a." + ending, tetrahedra(ending, 8));
  }
  const std::string real = folder.file("allowed/kept"), way = folder.file("allowed/way"), away = folder.file("away");
  fs::create_directory_symlink(folder.file("outside"), folder.file("link"));
  fs::rename(real, way);
  const Swapper swapper([&](unsigned) {
    ::rename(way.c_str(), away.c_str());
    ::rename(folder.file("link").c_str(), way.c_str());
    ::usleep(50);
    ::rename(way.c_str(), folder.file("link").c_str());
    ::rename(away.c_str(), way.c_str());
    ::usleep(200);
  });
  for (const std::string& ending : kEndings) load(way + "/a." + ending, 300);
  EXPECT_TRUE(bothSeen());
}

TEST_F(Swapped, ARefusalDoesNotTellWhatIsThereInstead) {
  const std::string file = folder.file("allowed/way/a.obj");
  folder.write("outside/a.obj", tetrahedra("obj", 4));
  std::vector<std::string> details;
  const auto read = [&] {
    const Result<TriangleMesh> mesh = readMeshFile(file);
    details.push_back(mesh ? "read" : mesh.error().detail);
  };
  read();  // missing
  fs::create_directory_symlink(folder.file("outside"), folder.file("allowed/way"));
  read();  // through a folder that is a link
  fs::remove(folder.file("outside/a.obj"));
  read();  // the same, to nothing
  fs::remove(folder.file("allowed/way"));
  fs::create_directories(folder.file("allowed/way"));
  fs::create_symlink(folder.file("kept.obj"), file);
  read();  // a link to nothing
  folder.write("kept.obj", tetrahedra("obj", 4));
  read();  // to a file
  for (const std::string& detail : details) EXPECT_EQ(detail, details[0]);
  EXPECT_NE(details[0].find("'a.obj' is missing"), std::string::npos) << details[0];
}

TEST_F(Swapped, AScenesFileForAPipe) {
  const std::string text = "bodies: [{name: inside, primitive: {box: [1, 1, 1]}, edge: 1}]\n";
  const std::string kept = folder.write("kept.yaml", text);
  const std::string file = folder.file("allowed/a.yaml"), next = folder.file("allowed/next");
  fs::copy_file(kept, file);
  const Swapper swapper([&](unsigned round) {
    if (round % 2 == 0 && ::link(kept.c_str(), next.c_str()) != 0) return;
    if (round % 2 == 1 && ::mkfifo(next.c_str(), 0600) != 0) return;
    ::rename(next.c_str(), file.c_str());
    if (round % 2 == 0) ::usleep(20);
  });
  for (int k = 0; k < 3000 || (!bothSeen() && k < 100000); ++k) (readScene(file, access) ? good : refused)++;
  EXPECT_TRUE(bothSeen());
}

// --- files that are large

constexpr int kLarge = 24;  // [MiB] more than the slack below, so that a second copy is seen

struct Cost {
  bool refused = false;
  double seconds = 0.0, mebibytes = 0.0;
  char detail[200] = "";
};

/// Reads in a process of its own: the most memory that a process had is never forgotten.
Cost costOf(const std::string& path) {
  Cost cost;
  int ends[2];
  if (::pipe(ends) != 0) return cost;
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(60);
    rusage before{}, after{};
    ::getrusage(RUSAGE_SELF, &before);
    {
      const Result<TriangleMesh> read = readMeshFile(path);
      cost.refused = !read.ok();
      if (!read) std::strncpy(cost.detail, read.error().detail.c_str(), sizeof cost.detail - 1);
    }
    ::getrusage(RUSAGE_SELF, &after);
    const auto seconds = [](const rusage& use) {
      return static_cast<double>(use.ru_utime.tv_sec + use.ru_stime.tv_sec) +
             1e-6 * static_cast<double>(use.ru_utime.tv_usec + use.ru_stime.tv_usec);
    };
    cost.seconds = seconds(after) - seconds(before);
    cost.mebibytes = static_cast<double>(after.ru_maxrss - before.ru_maxrss) / 1024.0;
    const bool sent = ::write(ends[1], &cost, sizeof cost) == sizeof cost;
    ::_exit(sent ? 0 : 1);
  }
  ::close(ends[1]);
  if (::read(ends[0], &cost, sizeof cost) != sizeof cost) {
    cost.seconds = 1e9;
    std::strcpy(cost.detail, "the process that read it has died");
  }
  ::close(ends[0]);
  ::waitpid(child, nullptr, 0);
  return cost;
}

void expectCheap(const Cost& cost, double mebibytes_of_file, const std::string& what) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  const double slack = 1e9;  // memory beside the memory
#else
  const double slack = 16.0;
#endif
  // Processor time: it grows with the size, and this much takes less than half a second.
  EXPECT_LT(cost.seconds, 10.0) << what << ": " << cost.detail;
  EXPECT_LT(cost.mebibytes, mebibytes_of_file + slack) << what << ": " << cost.detail;
}

// Files that are nearly all a hole.
TEST(LargeFiles, HolesAreNotReadAsText) {
  const TemporaryFolder folder;
  struct Case {
    std::string name, head, end;
    const char* refusal;  // empty: what follows the data is not looked at
  };
  const std::string ply =
      "ply\nformat FORMAT 1.0\nelement vertex POINTS\nproperty float x\nproperty float y\nproperty float z\n"
      "element face FACES\nproperty list uchar int vertex_indices\nend_header\n";
  const auto plyOf = [&](const std::string& format, const std::string& faces, const std::string& points = "1000") {
    std::string text = ply;
    text.replace(text.find("POINTS"), 6, points);
    text.replace(text.find("FORMAT"), 6, format);
    return text.replace(text.find("FACES"), 5, faces);
  };
  const auto withEdges = [](const std::string& text) {
    return std::string(text).insert(text.find("element face"), "element edge 4\nproperty int vertex1\n");
  };
  const std::string pcd =
      "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1000\nHEIGHT 1\nPOINTS 1000\nDATA ";
  const std::string vtk = "# vtk DataFile Version 3.0\nt\nFORMAT\nDATASET POLYDATA\nPOINTS 3 float\n";
  const auto vtkOf = [&](const std::string& format) { return std::string(vtk).replace(vtk.find("FORMAT"), 6, format); };
  const off_t size = static_cast<off_t>(kLarge) << 20;
  for (const Case& one : std::vector<Case>{
           {"zeros.obj", "", "", "the byte 0 at 0"},
           {"zeros.ply", "", "", "no PLY file"},
           {"zeros.stl", "", "", "promises 0 triangles"},
           {"zeros.pcd", "", "", "no PCD file"},
           {"zeros.vtk", "", "", "no legacy VTK file"},
           {"points.obj", "v 0 0 0\n", "", "the byte 0 at 8"},
           {"text.pcd", pcd + "ascii\n", "", "the byte 0 at 102"},
           {"binary.pcd", pcd + "binary\n", "", ""},
           {"packed.pcd", pcd + "binary_compressed\n", "", "compressed data"},
           {"text.ply", plyOf("ascii", "1"), "", "the byte 0 at 157"},
           {"faces.ply", plyOf("binary_little_endian", std::to_string(size - (1 << 20))), "",
            "faces; accepted: up to 8000000"},
           {"binary.ply", plyOf("binary_little_endian", "0"), "", ""},
           {"text.stl", "solid s\n", "\nendsolid s\n", "the byte 0 at 8"},
           {"text.vtk", vtkOf("ASCII") + "0 0 0 1 1 1 2 2 2\n", "", "the byte 0 at 85"},
           {"binary.vtk", vtkOf("BINARY"), "", ""},
           {"zeros.off", "", "", "the byte 0 at 0"},
           {"points.off", "OFF\n4 4 0\n", "", "the byte 0 at 10"},
           {"edges.ply", withEdges(plyOf("binary_little_endian", "0")), "", ""},
           {"edges_faces.ply", withEdges(plyOf("binary_little_endian", std::to_string(size - (1 << 20)))), "",
            "faces; accepted: up to 8000000"},
           {"edges_points.ply", withEdges(plyOf("binary_little_endian", "0", std::to_string(size / 12 - 1000))), "",
            "points; accepted: up to 2000000"}}) {
    const std::string path = folder.write(one.name, one.head);
    ASSERT_EQ(::truncate(path.c_str(), size - static_cast<off_t>(one.end.size())), 0);
    std::ofstream(path, std::ios::binary | std::ios::app) << one.end;
    const Cost cost = costOf(path);
    expectCheap(cost, kLarge, one.name);
    EXPECT_EQ(cost.refused, *one.refusal != '\0') << one.name;
    EXPECT_NE(std::string(cost.detail).find(one.refusal), std::string::npos) << one.name << ": " << cost.detail;
    std::cout << one.name << ": " << cost.seconds << " s, " << cost.mebibytes << " MiB; " << cost.detail << "\n";
    fs::remove(path);
  }
}

TEST(LargeFiles, MoreThanIsAcceptedIsNotRead) {
  const TemporaryFolder folder;
  for (const std::string& ending : kEndings) {
    const std::string name = "a." + ending, path = folder.write(name, "");
    ASSERT_EQ(::truncate(path.c_str(), (512 << 20) + 1), 0);
    const Cost cost = costOf(path);
    expectCheap(cost, 0.0, name);
    EXPECT_NE(std::string(cost.detail).find("has 536870913 bytes; accepted: up to 536870912 (512 MiB)"),
              std::string::npos)
        << cost.detail;
    fs::remove(path);
  }
}

TEST(LargeFiles, LinesOfAnyLengthAreNotHeld) {
  const TemporaryFolder folder;
  constexpr std::size_t kLength = static_cast<std::size_t>(kLarge) << 20;
  const auto without = [](const std::string& text, const std::string& from) { return text.substr(0, text.find(from)); };
  struct Case {
    std::string name, head;
    char filler;
  };
  for (const Case& one : std::vector<Case>{{"a.obj", "v ", '1'},
                                           {"b.obj", "# ", 'a'},
                                           {"c.obj", "f ", ' '},
                                           {"header.pcd", "FIELDS ", 'x'},
                                           {"words.pcd", without(tetrahedra("pcd", 4), "0 0 0"), '1'},
                                           {"blanks.pcd", without(tetrahedra("pcd", 4), "0 0 0"), ' '},
                                           {"header.ply", "ply\ncomment ", 'a'},
                                           {"edges.ply", without(tetrahedra("edges.ply", 4), "0 0 0"), '1'},
                                           {"a.off", "OFF\n4 4 0\n0 0 ", '1'},
                                           {"blanks.off", "OFF\n4 4 0\n", ' '},
                                           {"a.ply", without(tetrahedra("ply", 4), "0 0 0"), '1'},
                                           {"a.stl", "solid ", 'a'},
                                           {"a.vtk", "# ", 'a'},
                                           {"number.vtk", without(tetrahedra("vtk", 4), "0 0 0"), '1'},
                                           {"key.vtk", without(tetrahedra("vtk", 4), "POINTS"), 'a'}}) {
    const std::string path = folder.write(one.name, one.head + std::string(kLength, one.filler));
    const Cost cost = costOf(path);
    EXPECT_TRUE(cost.refused) << one.name;
    expectCheap(cost, kLarge, one.name);
    std::cout << one.name << ": " << cost.seconds << " s, " << cost.mebibytes << " MiB; " << cost.detail << "\n";
    fs::remove(path);
  }
}

TEST(LargeFiles, DataThatPromisesMoreThanItHolds) {
  const TemporaryFolder folder;
  // 464 MB of points from eight bytes.
  std::string packed =
      "VERSION 0.7\nFIELDS x y z n\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 55\nWIDTH 2000000\nHEIGHT 1\n"
      "POINTS 2000000\nDATA binary_compressed\n";
  const std::uint32_t sizes[] = {8, 464000000};
  packed.append(reinterpret_cast<const char*>(sizes), sizeof sizes).append(8, '\1');
  // One face with 2,147,483,647 corners.
  const std::string list =
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uint int vertex_indices\nend_header\n" +
      std::string(12, '\0') + "\xff\xff\xff\x7f" + std::string(100, '\0');
  // The first faces would be forgotten for the second.
  const std::string twice = std::string(list).insert(list.find("end_header"), "element face 1\n");
  for (const auto& [name, content] :
       std::map<std::string, std::string>{{"a.pcd", packed}, {"a.ply", list}, {"twice.ply", twice}}) {
    const Cost cost = costOf(folder.write(name, content));
    EXPECT_TRUE(cost.refused) << name;
    EXPECT_NE(std::string(cost.detail).find("damaged"), std::string::npos) << cost.detail;
    expectCheap(cost, 0.0, name);
  }
}

}  // namespace hostile_files_test
}  // namespace meshless
