#include "leap_object_tracker/geometry/object_model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.hpp"

namespace leap_object_tracker {
namespace {

using testing::HasSubstr;

class ObjectFile : public testing::Test {
 protected:
  ObjectModel load(const std::string& yaml) { return loadObject(folder_.write("o.yaml", yaml)); }
  std::string complaintAbout(const std::string& yaml) {
    try {
      load(yaml);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
  TemporaryFolder folder_;
};

TEST_F(ObjectFile, describesABox) {
  const ObjectModel box = load("name: a\nshape: box\nsize: [0.01, 0.02, 0.03]\n");
  EXPECT_EQ(box.name, "a");
  EXPECT_EQ(box.shape, Shape::kBox);
  EXPECT_EQ(box.mesh.triangles.size(), 12u);
  EXPECT_EQ(box.symmetry.rotations.size(), 4u);
}

TEST_F(ObjectFile, findsItsMeshBesideItself) {
  folder_.write("part.obj",
                "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 3 2\nf 1 2 4\nf 1 4 3\n"
                "f 2 3 4\n");
  const ObjectModel part = load("name: a\nshape: mesh\nmesh: part.obj\nscale: 0.001\n");
  EXPECT_EQ(part.mesh.triangles.size(), 4u);
  EXPECT_EQ(part.symmetry.rotations.size(), 3u) << "about the diagonal";
}

TEST_F(ObjectFile, mayStateWhetherItIsTextured) {
  const std::string box = "name: a\nshape: box\nsize: [1, 1, 1]\n";
  EXPECT_FALSE(load(box).textured.has_value());
  EXPECT_EQ(load(box + "textured: true\n").textured, true);
  EXPECT_EQ(load(box + "textured: false\n").textured, false);
  EXPECT_THAT(complaintAbout(box + "textured: a little\n"), HasSubstr("textured"));
}

TEST_F(ObjectFile, mayStateItsSymmetry) {
  EXPECT_TRUE(load("name: a\nshape: box\nsize: [1, 1, 1]\nsymmetry: none\n").symmetry.trivial());
  EXPECT_EQ(load("name: a\nshape: box\nsize: [1, 1, 1]\n"
                 "symmetry: [{axis: [0, 0, 1], order: 4}]\n")
                .symmetry.rotations.size(),
            4u);
  EXPECT_THAT(complaintAbout("name: a\nshape: box\nsize: [1, 1, 1]\nsymmetry: some\n"),
              HasSubstr("symmetry"));
}

TEST_F(ObjectFile, thatIsWrongIsAnErrorThatNamesFileAndKey) {
  const std::vector<std::pair<std::string, std::string>> wrong{
      {"shape: box\nsize: [1, 1, 1]\n", "name"},
      {"name: a\nshape: ball\nsize: [1]\n", "ball"},
      {"name: a\nshape: box\nsize: [1, 1]\n", "size"},
      {"name: a\nshape: box\nsize: [1, 1, 0]\n", "size"},
      {"name: a\nshape: box\nsize: [1, 1, .nan]\n", "size"},
      {"name: a\nshape: box\nsize: [1, 1, 1]\nweight: 3\n", "weight"},
      {"name: a\nshape: mesh\nmesh: no.stl\nscale: -1\n", "scale"},
      {"just words\n", "map"},
  };
  for (const auto& [yaml, word] : wrong) {
    EXPECT_THAT(complaintAbout(yaml), HasSubstr(word));
    EXPECT_THAT(complaintAbout(yaml), HasSubstr("o.yaml"));
  }
}

TEST_F(ObjectFile, refusesAMeshOfAnUnlikelySize) {
  folder_.write("part.obj",
                "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 3 2\nf 1 2 4\nf 1 4 3\n"
                "f 2 3 4\n");
  EXPECT_THAT(complaintAbout("name: a\nshape: mesh\nmesh: part.obj\n"), HasSubstr("scale"));
}

}  // namespace
}  // namespace leap_object_tracker
