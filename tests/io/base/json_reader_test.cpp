// Strict JSON: syntax errors carry their place, and no getter converts.
#include "io/base/json_reader.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "io/base/error.h"

namespace {

namespace fs = std::filesystem;

class JsonReaderTest : public testing::Test {
 protected:
  ~JsonReaderTest() override { fs::remove(path_); }

  io::JsonReader Parse(const std::string& text) {
    std::ofstream(path_, std::ios::binary) << text;
    return io::JsonReader::ReadDocument(path_);
  }
  // The message of the error; empty when the text is accepted.
  std::string Refusal(const std::string& text) {
    try {
      Parse(text);
      return "";
    } catch (const io::Error& error) {
      EXPECT_EQ(error.code(), io::ExitCode::kBadInput);
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return error.what();
    }
  }

  fs::path path_ = fs::temp_directory_path() / ("io_json_reader_test_" + std::to_string(getpid()) + ".json");
};

TEST_F(JsonReaderTest, SyntaxErrorsCarryTheirPlace) {
  EXPECT_NE(Refusal(""), "");
  EXPECT_NE(Refusal("{\"frames\": [").find("line 1, column 13"), std::string::npos);
  EXPECT_NE(Refusal("{\n}}").find("line 2, column 2"), std::string::npos);
  EXPECT_EQ(Refusal("\xEF\xBB\xBF{}"), "");
  for (const char* number : {"NaN", "Infinity", "-Infinity", "0x10", "01"})
    EXPECT_NE(Refusal(std::string("[") + number + "]").find("line 1"), std::string::npos) << number;
  EXPECT_NE(Refusal("[1e400]").find("byte 6"), std::string::npos) << Refusal("[1e400]");
  EXPECT_NE(Refusal(R"({"a": 1, "a": 1})").find("\"a\" occurs twice"), std::string::npos);
  EXPECT_EQ(Refusal(R"([{"a": 1}, {"a": 1}])"), "");
}

TEST_F(JsonReaderTest, NestingIsLimited) {
  const auto nested = [&](std::size_t n) { return Refusal(std::string(n, '[') + std::string(n, ']')); };
  EXPECT_EQ(nested(64), "");
  EXPECT_NE(nested(65).find("64 levels"), std::string::npos);
  EXPECT_NE(nested(1'000'000).find("64 levels"), std::string::npos);
}

TEST_F(JsonReaderTest, GettersNeverConvert) {
  const io::JsonReader json = Parse(
      R"({"list": [{"whole": 8, "real": 8.0, "part": 800.7, "big": 1e30, "text": "8", "yes": true, "none": null}]})");
  const io::JsonReader item = json.At("list").At(0);
  EXPECT_EQ(item.At("whole").Integer(1, 10), 8);
  EXPECT_EQ(item.At("real").Integer(1, 10), 8);
  EXPECT_EQ(item.At("part").Number(0, 1000), 800.7);
  EXPECT_EQ(item.At("text").String(), "8");
  EXPECT_TRUE(item.At("yes").Bool());
  EXPECT_TRUE(item.At("none").IsNull());
  EXPECT_FALSE(item.At("whole").IsNull());
  EXPECT_EQ(item.At("part").json_path(), "list[0].part");
  const auto refused = [&](const auto& getter) {
    try {
      getter();
      return std::string();
    } catch (const io::Error& error) {
      return std::string(error.what());
    }
  };
  for (const char* key : {"part", "big", "text", "yes", "none", "absent"}) {
    const std::string what = refused([&] { item.At(key).Integer(-1000, 1000); });
    EXPECT_NE(what.find("list[0]"), std::string::npos) << key;
    EXPECT_NE(what.find(key), std::string::npos) << key;
  }
  EXPECT_NE(refused([&] { item.At("whole").Number(9, 10); }), "");
  EXPECT_NE(refused([&] { item.At("whole").Number(6, 7); }), "");
  EXPECT_NE(refused([&] { item.At("whole").String(); }), "");
  EXPECT_NE(refused([&] { item.At("whole").Bool(); }), "");
  EXPECT_NE(refused([&] { item.At("none").Bool(); }), "");
  EXPECT_NE(refused([&] { item.Size(); }), "");
  EXPECT_NE(refused([&] { json.At("list").Has("x"); }), "");
  EXPECT_NE(refused([&] { json.At("list").Keys(); }), "");
  EXPECT_NE(refused([&] { json.At("list").At(1); }), "");
}

}  // namespace
