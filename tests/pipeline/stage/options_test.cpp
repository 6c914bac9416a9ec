// pipeline/stage/options.h: one line per option gives flag, config key, origin and written-back value.
#include "pipeline/stage/options.h"
#include "io/base/json.h"

#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

namespace {

using io::ExitCode;
using pipeline::Options;

struct Fields {
  bool depth = false, white = true;
  int steps = 100;
  std::uint64_t seed = 7;
  double rate = 0.01;
  std::string name = "hash";
  std::filesystem::path out, input;
};

// Parses `arguments` into fresh fields.
struct Parsed {
  explicit Parsed(std::vector<const char*> arguments) {
    options.AddPositional("INPUT", &fields.input, "what to read", false);
    options.Add("depth", &fields.depth, "a switch");
    options.Add("white", &fields.white, "a switch that is on");
    options.Add("steps", &fields.steps, "a count");
    options.Add("seed", &fields.seed, "a seed");
    options.Add("rate", &fields.rate, "a rate");
    options.Add("name", &fields.name, "a text");
    options.Add("out", &fields.out, "a folder", {.affects_result = false});
    arguments.insert(arguments.begin(), "pipeline test");
    wants_run = options.Parse(static_cast<int>(arguments.size()), arguments.data());
  }
  io::Json Resolved() const { return options.ResolvedJson(); }

  Fields fields;
  Options options{"pipeline test", "Tests."};
  bool wants_run = false;
};

TEST(Options, FlagsInBothSpellingsReachTheFields) {
  const Parsed parsed({"in put",
                       "--steps",
                       "-5",
                       "--rate=2.5e-3",
                       "--depth",
                       "--no-white",
                       "--name=a=b",
                       "--out",
                       "/x y",
                       "--seed",
                       "18446744073709551615"});
  EXPECT_TRUE(parsed.wants_run);
  EXPECT_EQ(parsed.fields.input, "in put");
  EXPECT_EQ(parsed.fields.steps, -5);
  EXPECT_EQ(parsed.fields.rate, 2.5e-3);
  EXPECT_TRUE(parsed.fields.depth);
  EXPECT_FALSE(parsed.fields.white);
  EXPECT_EQ(parsed.fields.name, "a=b");
  EXPECT_EQ(parsed.fields.out, "/x y");
  EXPECT_EQ(parsed.fields.seed, UINT64_MAX);
  EXPECT_EQ(parsed.options.ValueText("steps"), "-5");
  EXPECT_EQ(parsed.options.ValueText("depth"), "true");
  EXPECT_EQ(parsed.options.ValueText("out"), "/x y");
}

TEST(Options, DefaultsAndOriginsAreWrittenBack) {
  const TempDir dir;
  WriteText(dir / "c.json", R"({"steps": 9, "depth": true, "name": "mlp", "rate": 1})");
  const std::string config = (dir / "c.json").string();
  Parsed parsed({"--config", config.c_str(), "--steps=11"});
  EXPECT_EQ(parsed.fields.steps, 11);  // the flag wins, wherever it stands
  EXPECT_EQ(parsed.fields.rate, 1);
  EXPECT_TRUE(parsed.fields.depth);
  const auto resolved = parsed.Resolved();
  EXPECT_EQ(resolved["steps"], (io::Json{{"value", 11}, {"origin", "flag"}}));
  EXPECT_EQ(resolved["name"], (io::Json{{"value", "mlp"}, {"origin", "file"}}));
  EXPECT_EQ(resolved["white"], (io::Json{{"value", true}, {"origin", "default"}}));
  EXPECT_TRUE(parsed.options.IsSetByUser("steps"));
  EXPECT_TRUE(parsed.options.IsSetByUser("name"));
  EXPECT_FALSE(parsed.options.IsSetByUser("white"));
  EXPECT_FALSE(parsed.options.IsSetByUser("seed"));
}

TEST(Options, UnknownNamesAreUsageErrorsWithTheNearest) {
  EXPECT_ERROR(Parsed({"--step", "3"}), ExitCode::kUsage, "unknown option 'step'. Did you mean --steps?");
  EXPECT_ERROR(Parsed({"--dept"}), ExitCode::kUsage, "Did you mean --depth?");
  EXPECT_ERROR(Parsed({"--no-dept"}), ExitCode::kUsage, "Did you mean --depth?");
  EXPECT_ERROR(Parsed({"-s", "3"}), ExitCode::kUsage, "unknown option '-s'");
  EXPECT_ERROR(Parsed({"a", "b"}), ExitCode::kUsage, "unexpected argument 'b'");
}

TEST(Options, BadValuesNameTheOptionAndTheValue) {
  for (const char* value : {"x", "", "5x", "1.5", "99999999999"})
    EXPECT_ERROR(Parsed({"--steps", value}), ExitCode::kUsage, "--steps: '" + std::string(value) + "'");
  for (const char* value : {"nan", "inf", "1e999", "1,5"})
    EXPECT_ERROR(Parsed({"--rate", value}), ExitCode::kUsage, "--rate: '" + std::string(value) + "'");
  EXPECT_ERROR(Parsed({"--seed", "-1"}), ExitCode::kUsage, "--seed");
  EXPECT_ERROR(Parsed({"--depth=maybe"}), ExitCode::kUsage, "neither true nor false");
  EXPECT_ERROR(Parsed({"--no-depth=true"}), ExitCode::kUsage, "takes no value");
  EXPECT_ERROR(Parsed({"--no-steps"}), ExitCode::kUsage, "no switch");
  EXPECT_ERROR(Parsed({"--steps"}), ExitCode::kUsage, "--steps needs a value");
}

TEST(Options, ConfigFilesAreReadStrictly) {
  const TempDir dir;
  const std::string path = (dir / "c.json").string();
  const auto parse = [&](const std::string& text) {
    WriteText(path, text);
    Parsed({"--config", path.c_str()});
  };
  EXPECT_ERROR(parse(R"({"stepz": 3})"), ExitCode::kUsage, "Did you mean --steps?");
  EXPECT_ERROR(parse(R"({"steps": "3"})"), ExitCode::kUsage, "\"steps\": \"3\" has the wrong type");
  EXPECT_ERROR(parse(R"({"steps": 3.5})"), ExitCode::kUsage, "--steps: '3.5'");
  EXPECT_ERROR(parse(R"({"steps": null})"), ExitCode::kUsage, "wrong type");
  EXPECT_ERROR(parse(R"({"out": 3})"), ExitCode::kUsage, "wrong type");
  EXPECT_ERROR(parse(R"({"depth": 1})"), ExitCode::kUsage, "wrong type");
  EXPECT_ERROR(parse(R"({"steps": 3, "steps": 4})"), ExitCode::kUsage, "given twice");
  EXPECT_ERROR(parse(R"({"rate": 1e400})"), ExitCode::kUsage, "c.json");
  EXPECT_ERROR(parse("[1]"), ExitCode::kUsage, "not a JSON object");
  EXPECT_ERROR(parse("{\"steps\":"), ExitCode::kUsage, "line 1");
  EXPECT_ERROR(Parsed({"--config", "/none.json"}), ExitCode::kBadInput, "/none.json");
}

TEST(Options, DoubleDashEndsOptionsAndRequiredInputIsDemanded) {
  EXPECT_EQ(Parsed({"--", "-odd"}).fields.input, "-odd");
  Options options("pipeline test", "Tests.");
  std::filesystem::path input;
  options.AddPositional("INPUT", &input, "what to read", true);
  const char* argv[] = {"pipeline test"};
  EXPECT_ERROR(options.Parse(1, argv), ExitCode::kUsage, "INPUT is missing");
}

TEST(Options, KeyHoldsExactlyWhatAffectsTheResult) {
  const std::string base = Parsed({}).options.KeyText();
  EXPECT_EQ(Parsed({"other input", "--out=/elsewhere"}).options.KeyText(), base);
  EXPECT_EQ(Parsed({"--steps=100"}).options.KeyText(), base);  // the value counts, not who gave it
  EXPECT_NE(Parsed({"--steps=101"}).options.KeyText(), base);
  EXPECT_NE(Parsed({"--no-white"}).options.KeyText(), base);
}

TEST(Options, NamesThatAreNotUtf8AreKept) {
  const Parsed parsed({"--out", "caf\xe9"});
  EXPECT_EQ(parsed.fields.out, "caf\xe9");
  EXPECT_EQ(parsed.Resolved()["out"]["value"], "caf\xe9");
  EXPECT_TRUE(!io::ParseJson(parsed.options.KeyText()).is_discarded());
}

TEST(Options, HelpListsEveryOptionWithItsDefault) {
  testing::internal::CaptureStdout();
  const Parsed parsed({"--help", "--nonsense"});
  const std::string help = testing::internal::GetCapturedStdout();
  EXPECT_FALSE(parsed.wants_run);
  EXPECT_TRUE(help.starts_with("usage: pipeline test [INPUT] [options]\n\nTests.\n"));
  for (const char* part :
       {"--depth", "a switch [false]", "--steps", "[100]", "[0.01]", "[\"hash\"]", "--config"})
    EXPECT_NE(help.find(part), std::string::npos) << part;
}

TEST(Options, EmptyValuesAreRefused) {
  for (const char* option : {"name", "out", "steps", "rate", "depth", "config"}) {
    const std::string bare = "--" + std::string(option), flag = bare + "=";
    // What follows is not taken for the value.
    EXPECT_ERROR(Parsed({flag.c_str(), "3"}), ExitCode::kUsage, bare + ": '' is no value");
  }
  EXPECT_ERROR(Parsed({"--name", ""}), ExitCode::kUsage, "--name: '' is no value");
  EXPECT_ERROR(Parsed({""}), ExitCode::kUsage, "INPUT: '' is no value");
  const TempDir dir;
  const std::string path = (dir / "c.json").string();
  WriteText(path, R"({"name": ""})");
  EXPECT_ERROR(Parsed({"--config", path.c_str()}), ExitCode::kUsage, "--name: '' is no value");
}

TEST(Options, ValuesThatMustBeGivenMayComeFromTheFile) {
  const TempDir dir;
  const auto out_of = [](std::vector<const char*> arguments) {
    Options options("pipeline test", "Tests.");
    std::filesystem::path out;
    options.Add("out", &out, "a folder", {.required = "DIR"});
    arguments.insert(arguments.begin(), "pipeline test");
    return options.Parse(static_cast<int>(arguments.size()), arguments.data()) ? out : "help";
  };
  EXPECT_ERROR(out_of({}), ExitCode::kUsage, "pipeline test: --out DIR is missing");
  EXPECT_EQ(out_of({"--out", "run"}), "run");
  WriteText(dir / "config.json", R"({"out": "from the file"})");
  const std::string config = (dir / "config.json").string();
  EXPECT_EQ(out_of({"--config", config.c_str()}), "from the file");
  EXPECT_EQ(out_of({"--help"}), "help");
}

TEST(Options, TheLastOfRepeatedFlagsCounts) {
  EXPECT_EQ(Parsed({"--steps=3", "--steps", "4"}).fields.steps, 4);
  EXPECT_TRUE(Parsed({"--no-depth", "--depth"}).fields.depth);
  EXPECT_FALSE(Parsed({"--depth", "--no-depth"}).fields.depth);
  EXPECT_FALSE(Parsed({"--depth", "--depth=false"}).fields.depth);
}

// Options with a rule each, and all that Parse wrote into them.
struct Ruled {
  explicit Ruled(std::vector<const char*> arguments) : options("pipeline test", "Tests.") {
    options.Add("count", &count, "a count", {.min = 2, .max = 9});
    options.Add("share", &share, "a share", {.above = 0, .below = 1});
    options.Add("seed", &seed, "a seed", {.max = 5});
    options.Add("rays", &rays, "rays", {.choices = {"0", "4"}});
    options.Add("way", &way, "a way", {.choices = {"left", "right"}});
    options.Add("time", &time, "a time", {.check = pipeline::ParseDuration});
    arguments.insert(arguments.begin(), "pipeline test");
    options.Parse(static_cast<int>(arguments.size()), arguments.data());
  }
  int count = 3, rays = 0;
  double share = 0.5;
  std::uint64_t seed = 0;
  std::string way = "left", time = "1m";
  Options options;
};

TEST(Options, RulesAreKeptByFlagsAndByTheFile) {
  const TempDir dir;
  const std::string path = (dir / "c.json").string();
  struct Case {
    const char *option, *value;
    bool is_allowed;
  };
  for (const Case& c : {Case{"count", "1", false},
                        {"count", "2", true},
                        {"count", "9", true},
                        {"count", "10", false},
                        {"share", "0", false},
                        {"share", "1e-9", true},
                        {"share", "0.999999", true},
                        {"share", "1", false},
                        {"share", "1e20", false},
                        {"seed", "5", true},
                        {"seed", "6", false},
                        {"rays", "04", true},
                        {"rays", "1", false},
                        {"way", "right", true},
                        {"way", "Left", false},
                        {"time", "30m", true},
                        {"time", "0s", false},
                        {"time", "731h", false},
                        {"time", "99999999999999999999", false}}) {
    const std::string flag = "--" + std::string(c.option) + "=" + c.value;
    const bool is_text = c.option == std::string("way") || c.option == std::string("time");
    const std::string quote = is_text ? "\"" : "";
    const bool is_json = c.value != std::string("04");
    WriteText(path, "{\"" + std::string(c.option) + "\": " + quote + (is_json ? c.value : "4") + quote + "}");
    for (const std::string& argument : {flag, "--config=" + path}) {
      if (c.is_allowed) {
        EXPECT_NO_THROW(Ruled({argument.c_str()})) << flag;
      } else {
        EXPECT_ERROR(Ruled({argument.c_str()}), ExitCode::kUsage, "--" + std::string(c.option) + ": ");
      }
    }
  }
  EXPECT_ERROR(Ruled({"--count=1"}), ExitCode::kUsage, "Allowed: at least 2, at most 9");
  EXPECT_ERROR(Ruled({"--way=up"}), ExitCode::kUsage, "--way: 'up' is unknown. Known: left, right");
}

TEST(Options, PresetsGiveWayToFlags) {
  Ruled ruled({"--count=4"});
  const char* argv[] = {"pipeline test", "--count=4"};
  ruled.options.ApplyPreset(2, argv, [&] {
    ruled.count = 9;
    ruled.way = "right";
  });
  EXPECT_EQ(ruled.count, 4);
  EXPECT_EQ(ruled.way, "right");
  const io::Json resolved = ruled.options.ResolvedJson();
  EXPECT_EQ(resolved["count"]["origin"], "flag");
  EXPECT_EQ(resolved["way"], (io::Json{{"value", "right"}, {"origin", "preset"}}));
  EXPECT_EQ(resolved["share"]["origin"], "default");
  EXPECT_FALSE(ruled.options.IsSetByUser("way"));
}

TEST(Options, OptionsOfOthersKeepFieldRuleAndHelp) {
  Ruled ruled({});
  Options options("pipeline other", "Tests.");
  options.AddFrom(ruled.options, "count", "how-many", "counting");
  const char* good[] = {"pipeline other", "--how-many=7"};
  EXPECT_TRUE(options.Parse(2, good));
  EXPECT_EQ(ruled.count, 7);
  EXPECT_EQ(options.ValueText("how-many"), "7");
  const char* bad[] = {"pipeline other", "--how-many=10"};
  EXPECT_ERROR(options.Parse(2, bad), ExitCode::kUsage, "--how-many: 10 is out of range");
  testing::internal::CaptureStdout();
  const char* help[] = {"pipeline other", "--help"};
  EXPECT_FALSE(options.Parse(2, help));
  EXPECT_NE(testing::internal::GetCapturedStdout().find("a count (counting); at least 2, at most 9 [3]"),
            std::string::npos);
}

TEST(Options, DecibelsAreReadWithAndWithoutTheirUnit) {
  EXPECT_EQ(pipeline::ParseDecibels("target", "30"), 30);
  EXPECT_EQ(pipeline::ParseDecibels("target", "28.5dB"), 28.5);
  for (const char* text : {"", "dB", "0", "-3dB", "100dB", "30m", "nan"})
    EXPECT_ERROR(
        pipeline::ParseDecibels("target", text), ExitCode::kUsage, "--target: '" + std::string(text) + "'");
}

TEST(Options, DurationsAndNearestNames) {
  EXPECT_EQ(pipeline::ParseDuration("time", "90"), 90);
  EXPECT_EQ(pipeline::ParseDuration("time", "20s"), 20);
  EXPECT_EQ(pipeline::ParseDuration("time", "1.5m"), 90);
  EXPECT_EQ(pipeline::ParseDuration("time", "2h"), 7200);
  for (const char* text : {"", "m", "5x", "-3s", "nan", "5 m", "5mm"})
    EXPECT_ERROR(
        pipeline::ParseDuration("time", text), ExitCode::kUsage, "--time: '" + std::string(text) + "'");
  EXPECT_EQ(pipeline::NearestName("trian", {"train", "render", "sfm"}), "train");
  EXPECT_EQ(pipeline::NearestName("tiem", {"view", "time"}), "time");  // swapped letters are one mistake
  EXPECT_EQ(pipeline::NearestName("x", {}), "");
}

}  // namespace
