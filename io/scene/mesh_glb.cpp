// Meshes as binary glTF, written by tinygltf.
#include <tiny_gltf.h>

#include <bit>
#include <cmath>
#include <sstream>

#include "io/base/atomic_file.h"
#include "io/base/check.h"
#include "io/scene/mesh.h"

namespace io {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF bytes are copied as they lie in memory");

using Model = tinygltf::Model;

Eigen::Vector3f YUp(const Eigen::Vector3f& x) { return {x.x(), x.z(), -x.y()}; }

// sRGB (IEC 61966-2-1) to linear light, in 1/65535: 8 bits would turn dark tones into steps.
std::array<std::uint16_t, 256> LinearOfSrgb() {
  std::array<std::uint16_t, 256> linear;
  for (std::size_t i = 0; i < 256; ++i) {
    const double s = static_cast<double>(i) / 255;
    const double value = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
    linear[i] = static_cast<std::uint16_t>(std::lround(65535 * value));
  }
  return linear;
}

// Appends n values of `components` numbers each to the buffer, and returns the index of their accessor. Every
// number of values keeps the buffer at a multiple of 4 bytes, as the format asks.
template <typename T>
int AddAccessor(
    const std::vector<T>& values, std::size_t n, int component, int type, int target, Model* model) {
  std::vector<unsigned char>& bytes = model->buffers[0].data;
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = bytes.size();
  view.byteLength = values.size() * sizeof(T);
  view.target = target;
  const auto* begin = reinterpret_cast<const unsigned char*>(values.data());
  bytes.insert(bytes.end(), begin, begin + view.byteLength);
  model->bufferViews.push_back(view);
  tinygltf::Accessor accessor;
  accessor.bufferView = static_cast<int>(model->bufferViews.size()) - 1;
  accessor.componentType = component;
  accessor.type = type;
  accessor.count = n;
  model->accessors.push_back(accessor);
  return static_cast<int>(model->accessors.size()) - 1;
}

int AddVectors(const std::vector<Eigen::Vector3f>& vectors, bool bounds, Model* model) {
  std::vector<float> values;
  values.reserve(3 * vectors.size());
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max()), high = -low;
  for (const Eigen::Vector3f& vector : vectors) {
    const Eigen::Vector3f turned = YUp(vector);
    values.insert(values.end(), turned.begin(), turned.end());
    low = low.cwiseMin(turned), high = high.cwiseMax(turned);
  }
  const int index = AddAccessor(values,
                                vectors.size(),
                                TINYGLTF_COMPONENT_TYPE_FLOAT,
                                TINYGLTF_TYPE_VEC3,
                                TINYGLTF_TARGET_ARRAY_BUFFER,
                                model);
  if (bounds) {
    model->accessors.back().minValues.assign(low.begin(), low.end());
    model->accessors.back().maxValues.assign(high.begin(), high.end());
  }
  return index;
}

int AddColours(const Mesh& mesh, Model* model) {
  static const std::array<std::uint16_t, 256> linear = LinearOfSrgb();
  std::vector<std::uint16_t> rgba;
  rgba.reserve(4 * mesh.colours.size());
  for (const std::array<std::uint8_t, 3>& colour : mesh.colours) {
    for (const std::uint8_t c : colour) rgba.push_back(linear[c]);
    rgba.push_back(65535);
  }
  const int index = AddAccessor(rgba,
                                mesh.colours.size(),
                                TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT,
                                TINYGLTF_TYPE_VEC4,
                                TINYGLTF_TARGET_ARRAY_BUFFER,
                                model);
  model->accessors.back().normalized = true;
  return index;
}

int AddMaterial(Model* model) {
  tinygltf::Material material;
  material.pbrMetallicRoughness.metallicFactor = 0;  // for viewers that do not know the extension
  material.doubleSided = true;
  material.extensions["KHR_materials_unlit"] = tinygltf::Value(tinygltf::Value::Object());
  model->materials.push_back(material);
  model->extensionsUsed = {"KHR_materials_unlit"};
  return 0;
}

}  // namespace

void WriteMeshGlb(const std::filesystem::path& path, const Mesh& mesh, const std::string& remark) {
  CheckMesh(mesh);
  PIPELINE_CHECK(!mesh.triangles.empty());  // the format has no empty accessors
  Model model;
  model.asset.version = "2.0";
  model.asset.generator = remark;
  model.buffers.emplace_back();
  tinygltf::Primitive primitive;
  primitive.attributes["POSITION"] = AddVectors(mesh.positions, true, &model);
  primitive.attributes["NORMAL"] = AddVectors(mesh.normals, false, &model);
  primitive.attributes["COLOR_0"] = AddColours(mesh, &model);
  primitive.indices = AddAccessor(mesh.triangles,
                                  3 * mesh.triangles.size(),
                                  TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT,
                                  TINYGLTF_TYPE_SCALAR,
                                  TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER,
                                  &model);
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.material = AddMaterial(&model);
  model.meshes.emplace_back();
  model.meshes[0].primitives = {primitive};
  model.nodes.emplace_back();
  model.nodes[0].mesh = 0;
  model.scenes.emplace_back();
  model.scenes[0].nodes = {0};
  model.defaultScene = 0;
  std::ostringstream out;
  PIPELINE_CHECK(tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, out, false, true));
  WriteFileAtomically(path, out.view());
}

}  // namespace io
