// A command line, one argument per line, and the configuration file that it may name as "config.json". One
// option of each type, as the stages bind theirs.
#include <cstdio>

#include "pipeline/stage/common_options.h"
#include "pipeline/stage/options.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

struct Values {
  pipeline::CommonOptions common;
  bool flag = false;
  std::uint64_t seed = 1;
  double rate = 0.5;
  std::string kind = "hash";
};

void Parse(const std::vector<std::string>& arguments) {
  Values values;
  pipeline::Options options("pipeline fuzz", "Parses.");
  pipeline::AddCommonOptions(&options, &values.common, false);
  options.Add("flag", &values.flag, "A switch");
  options.Add("seed", &values.seed, "A whole number");
  options.Add("rate", &values.rate, "A number", {.max = 1, .above = 0});
  options.Add("kind", &values.kind, "A choice", {.choices = {"hash", "nerf"}});
  options.AddPositional("input", &values.common.out, "A path", false);
  std::vector<const char*> argv = {"pipeline-fuzz"};
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  fuzz::MayRefuse([&] {
    options.Parse(static_cast<int>(argv.size()), argv.data());
    options.KeyText();
    pipeline::ResolvedThreads(values.common);
  });
  fuzz::MayRefuse([&] { pipeline::ParseDuration("time", arguments.empty() ? "" : arguments.back()); });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool is_quiet = std::freopen("/dev/null", "w", stdout) != nullptr;  // --help
  const std::vector<std::string> files = fuzz::Files(data, size);
  const std::string config = fuzz::Write("config.json", files.size() > 1 ? files[1] : "{}").string();
  std::vector<std::string> arguments;
  for (std::size_t start = 0; is_quiet && start <= files[0].size();) {
    const std::size_t end = std::min(files[0].find('\n', start), files[0].size());
    std::string argument = files[0].substr(start, end - start);
    argument = argument.substr(0, argument.find('\0'));
    arguments.push_back(argument == "config.json" ? config : argument);
    start = end + 1;
  }
  Parse(arguments);
  return 0;
}
