#include "leap_object_tracker/geometry/object_model.hpp"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <filesystem>
#include <set>
#include <stdexcept>

#include "leap_object_tracker/geometry/mesh_symmetry.hpp"

namespace leap_object_tracker {
namespace {

/// One object file; every complaint names the file.
class ObjectFile {
 public:
  explicit ObjectFile(const std::string& path) : path_(path) {
    try {
      root_ = YAML::LoadFile(path);
    } catch (const YAML::BadFile&) {
      complain("cannot open the file");
    } catch (const YAML::Exception& error) {
      complain(std::string("is not valid YAML: ") + error.what());
    }
    if (!root_.IsMap()) complain("must be a map of keys (name, shape, size ...)");
  }

  [[noreturn]] void complain(const std::string& what) const {
    throw std::runtime_error("object file '" + path_ + "': " + what);
  }

  bool has(const std::string& key) const { return static_cast<bool>(root_[key]); }
  YAML::Node node(const std::string& key) const { return root_[key]; }

  template <class T>
  T read(const std::string& key, const std::string& expected) const {
    if (!has(key)) complain("the key '" + key + "' is missing; expected " + expected);
    try {
      return root_[key].as<T>();
    } catch (const YAML::Exception&) {
      complain("the key '" + key + "' must be " + expected);
    }
  }

  void refuseUnknownKeys(const std::set<std::string>& known) const {
    for (const auto& entry : root_) {
      const auto key = entry.first.as<std::string>();
      if (known.count(key) != 0) continue;
      std::string list;
      for (const auto& name : known) list += (list.empty() ? "" : ", ") + name;
      complain("unknown key '" + key + "'; known keys: " + list);
    }
  }

  const std::string& path() const { return path_; }

 private:
  std::string path_;
  YAML::Node root_;
};

Shape readShape(const ObjectFile& file) {
  const std::string expected = "box, cylinder, prism or mesh";
  const auto word = file.read<std::string>("shape", expected);
  if (word == "box") return Shape::kBox;
  if (word == "cylinder") return Shape::kCylinder;
  if (word == "prism") return Shape::kPrism;
  if (word == "mesh") return Shape::kMesh;
  file.complain("unknown shape '" + word + "'; expected " + expected);
}

Eigen::Vector3d readSize(const ObjectFile& file, Shape shape) {
  const std::size_t count = shape == Shape::kBox ? 3 : 2;
  const std::string expected = shape == Shape::kBox        ? "[x, y, z] in metres"
                               : shape == Shape::kCylinder ? "[radius, height] in metres"
                                                           : "[side, height] in metres";
  const auto values = file.read<std::vector<double>>("size", expected);
  if (values.size() != count)
    file.complain("the key 'size' must be " + expected + ", " + std::to_string(count) +
                  " numbers, not " + std::to_string(values.size()));
  Eigen::Vector3d size = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    if (!(values[i] > 0) || !(values[i] < 10))
      file.complain("the key 'size' must hold lengths above 0 and below 10 m: " + expected);
    size[static_cast<Eigen::Index>(i)] = values[i];
  }
  return size;
}

/// Of a mesh: see symmetryOf().
Symmetry primitiveSymmetry(Shape shape, const Eigen::Vector3d& size) {
  const Eigen::Vector3d x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  const auto same = [](double a, double b) { return std::abs(a - b) < 1e-6; };
  switch (shape) {
    case Shape::kBox:
      return symmetryFromAxes({{x, same(size.y(), size.z()) ? 4 : 2},
                               {y, same(size.x(), size.z()) ? 4 : 2},
                               {z, same(size.x(), size.y()) ? 4 : 2}});
    case Shape::kCylinder:
      return symmetryFromAxes({{z, 0}, {x, 2}});
    case Shape::kPrism:
      return symmetryFromAxes({{z, 3}, {y, 2}});
    case Shape::kMesh:
      break;
  }
  return {};
}

Mesh shapeMesh(Shape shape, const Eigen::Vector3d& size) {
  if (shape == Shape::kBox) return makeBox(size);
  if (shape == Shape::kCylinder) return makeCylinder(size.x(), size.y());
  return makePrism(size.x(), size.y());
}

Symmetry::Axis readAxis(const ObjectFile& file, const YAML::Node& entry) {
  const std::string expected =
      "a list of {axis: [x, y, z], order: N}, N at least 0, 0 for any angle";
  try {
    if (!entry.IsMap() || entry.size() != 2) throw std::invalid_argument("");
    const auto axis = entry["axis"].as<std::vector<double>>();
    const int order = entry["order"].as<int>();
    if (axis.size() != 3 || order < 0) throw std::invalid_argument("");
    return {Eigen::Vector3d(axis[0], axis[1], axis[2]), order};
  } catch (const std::exception&) {
    file.complain("the key 'symmetry' must be auto, none or " + expected);
  }
}

Symmetry ownSymmetry(const ObjectModel& object) {
  return object.shape == Shape::kMesh ? symmetryOf(object.mesh)
                                      : primitiveSymmetry(object.shape, object.size);
}

Symmetry readSymmetry(const ObjectFile& file, const ObjectModel& object) {
  if (!file.has("symmetry")) return ownSymmetry(object);
  const YAML::Node node = file.node("symmetry");
  if (node.IsScalar()) {
    const auto word = node.as<std::string>();
    if (word == "auto") return ownSymmetry(object);
    if (word == "none") return {};
  }
  std::vector<Symmetry::Axis> axes;
  if (!node.IsSequence()) readAxis(file, YAML::Node());
  for (const auto& entry : node) axes.push_back(readAxis(file, entry));
  try {
    return symmetryFromAxes(axes);
  } catch (const std::invalid_argument& error) {
    file.complain(error.what());
  }
}

}  // namespace

ObjectModel makePrimitive(const std::string& name, Shape shape, const Eigen::Vector3d& size) {
  const int count = shape == Shape::kBox ? 3 : 2;
  if (shape == Shape::kMesh || !(size.head(count).minCoeff() > 0))
    throw std::invalid_argument("makePrimitive: sizes must be positive");
  ObjectModel object;
  object.name = name;
  object.shape = shape;
  object.size = size;
  object.mesh = shapeMesh(shape, size);
  object.symmetry = primitiveSymmetry(shape, size);
  return object;
}

ObjectModel loadObject(const std::string& path) {
  const ObjectFile file(path);
  const Shape shape = readShape(file);
  ObjectModel object;
  if (shape == Shape::kMesh) {
    file.refuseUnknownKeys({"name", "shape", "mesh", "scale", "symmetry", "textured"});
    const auto mesh_path = file.read<std::string>("mesh", "the path of an OBJ, STL, PLY or DAE");
    const double scale = file.has("scale") ? file.read<double>("scale", "a number above 0") : 1.0;
    if (!(scale > 0) || !std::isfinite(scale))
      file.complain("the key 'scale' must be a number above 0 (metres per unit of the mesh)");
    object.shape = shape;
    object.mesh_path =
        std::filesystem::absolute(std::filesystem::path(path).parent_path() / mesh_path)
            .lexically_normal()
            .string();
    try {
      object.mesh = loadMesh(object.mesh_path, scale);
    } catch (const std::runtime_error& error) {
      file.complain(error.what());
    }
    const double diameter = diameterOf(object.mesh);
    if (!(diameter > 0.002) || !(diameter < 2))
      file.complain("the mesh is " + std::to_string(diameter) +
                    " m across; sizes from 2 mm to 2 m are sensible: is 'scale' right?");
  } else {
    file.refuseUnknownKeys({"name", "shape", "size", "symmetry", "textured"});
    object = makePrimitive("", shape, readSize(file, shape));
  }
  object.name = file.read<std::string>("name", "a word");
  object.symmetry = readSymmetry(file, object);
  if (file.has("textured")) object.textured = file.read<bool>("textured", "true or false");
  return object;
}

}  // namespace leap_object_tracker
