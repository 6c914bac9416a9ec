// The two kinds of radiance field and their names in flags and checkpoints.
#pragma once

#include <optional>
#include <string>

namespace nerf {

enum class FieldKind {
  kHash,  // hash grid and two small networks: hash_field.h
  kMlp    // the network of the original NeRF: mlp_field.h
};

struct NamedFieldKind {
  FieldKind kind;
  const char* name;
};
inline constexpr NamedFieldKind kFieldKinds[] = {{FieldKind::kHash, "hash"}, {FieldKind::kMlp, "nerf"}};

inline std::string NameOf(FieldKind kind) { return kFieldKinds[static_cast<std::size_t>(kind)].name; }

inline std::optional<FieldKind> FieldKindOf(const std::string& name) {
  for (const NamedFieldKind& known : kFieldKinds) {
    if (known.name == name) return known.kind;
  }
  return std::nullopt;
}

}  // namespace nerf
