#include "pipeline/page/page_export.h"

#include <nlohmann/json.hpp>

#include "io/base/atomic_file.h"
#include "io/base/base64.h"
#include "io/base/error.h"
#include "io/base/gzip.h"
#include "io/base/json.h"
#include "nerf/fields/checkpoint.h"
#include "pipeline/film/scene_json.h"
#include "pipeline/page/field_payload.h"
#include "pipeline/page/page_assets.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

// Replaces each {{NAME}} of the template, once; values are not searched again.
std::string Fill(std::string_view page, const std::map<std::string, std::string, std::less<>>& values) {
  std::string filled;
  for (std::size_t begin; (begin = page.find("{{")) != std::string_view::npos;) {
    const std::size_t end = page.find("}}", begin);
    filled.append(page.substr(0, begin)).append(values.find(page.substr(begin + 2, end - begin - 2))->second);
    page.remove_prefix(end + 2);
  }
  return filled.append(page);
}

// In a script element "</script>" and "<!--" would end what is meant as text.
std::string ScriptJson(const io::Json& json) {
  std::string text;
  for (const char c : json.dump(-1, ' ', true, io::Json::error_handler_t::replace))
    text += c == '<' ? "\\u003c" : std::string(1, c);
  return text;
}

}  // namespace

std::size_t ExportPage(const io::Scene& train,
                       const fs::path& checkpoint,
                       const std::string& name,
                       const fs::path& file,
                       std::size_t max_bytes) {
  if (nerf::KindOfCheckpoint(checkpoint) != nerf::FieldKind::kHash)
    throw io::Error(io::ExitCode::kBadInput,
                    checkpoint.string() + ": a browser can only show a field of kind `hash`",
                    "Train with --field hash");
  nerf::TrainState state;
  const std::unique_ptr<nerf::SceneField> field = nerf::ReadCheckpoint(checkpoint, &state);
  const auto page_with = [&](const FieldPayload& payload) {
    return Fill(kScenePage,
                {{"STYLE", kScenePageStyle},
                 {"SCRIPT", kScenePageScript},
                 {"SHADER", kScenePageShader},
                 {"SPLAT_VERTEX", kSplatVertexShader},
                 {"SPLAT_FRAGMENT", kSplatFragmentShader},
                 {"MIXING", kMixingShader},
                 {"SCENE", ScriptJson(SceneJson(train, name))},
                 {"FIELD", payload.description},
                 {"BYTES", io::Base64(io::Gzip(payload.bytes))}});
  };
  std::string page = page_with(MakeFieldPayload(field.get(), state.channels == 4));
  if (page.size() > max_bytes) {
    field->splats = {};  // the field alone shows all, less sharply
    page = page_with(MakeFieldPayload(field.get(), state.channels == 4));
  }
  if (page.size() > max_bytes)
    throw io::Error(io::ExitCode::kBadInput,
                    file.string() + ": would have " + std::to_string(page.size() >> 20) +
                        " MiB, more than the " + std::to_string(max_bytes >> 20) + " MiB that phones open",
                    "Train with --log2-hashmap-size 19");
  io::WriteFileAtomically(file, page);
  return page.size();
}

}  // namespace pipeline
