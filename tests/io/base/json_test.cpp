#include "io/base/json.h"

#include <nlohmann/json.hpp>

namespace io {
namespace {

TEST(Json, KeysStayInTheirOrder) {
  const std::string text = R"({"zebra":1,"ant":[true,null,0.1],"mole":{"b":"x","a":-2}})";
  EXPECT_EQ(DumpJson(ParseJson(text)), text);
}

TEST(Json, LevelsAreIndented) { EXPECT_EQ(DumpJson(Json{{"a", {1}}}, 1), "{\n \"a\": [\n  1\n ]\n}"); }

TEST(Json, WhatIsNoJsonIsDiscarded) {
  for (const char* text : {"", "{", "{\"a\":}", "[1,]", "nan", "\"\xff\"", "1 2"})
    EXPECT_TRUE(ParseJson(text).is_discarded()) << text;
}

TEST(Json, TextThatIsNotUtf8IsWrittenAllTheSame) {
  EXPECT_EQ(DumpJson(Json("caf\xe9.jpg")), "\"caf\xef\xbf\xbd.jpg\"");
  EXPECT_EQ(DumpJson(Json("caf\xc3\xa9.jpg")), "\"caf\xc3\xa9.jpg\"");
}

}  // namespace
}  // namespace io
