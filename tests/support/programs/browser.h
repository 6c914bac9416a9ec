// Chromium without a window, driven by its debugging protocol over two pipes.
#pragma once

#include <filesystem>
#include <string>
#include "io/base/json.h"

#include "tests/support/files/temp_dir.h"

class Browser {
 public:
  // Opens a page of width x height pixels. Throws std::runtime_error when Chromium does not start or does not
  // answer in 30 seconds.
  explicit Browser(const std::string& url, int width = 1000, int height = 700);
  ~Browser();

  // Value of a JavaScript expression in the page; promises are awaited.
  io::Json Evaluate(const std::string& expression);
  // Whether the expression becomes true within 20 seconds.
  bool Becomes(const std::string& expression);
  void Drag(double x, double y, double to_x, double to_y);
  void Wheel(double x, double y, double delta);
  void Key(const std::string& key, const std::string& type);  // type: keyDown or keyUp
  void Screenshot(const std::filesystem::path& png);

 private:
  io::Json Call(const std::string& method, const io::Json& parameters);
  io::Json Receive();
  void Mouse(const std::string& type, double x, double y, const io::Json& more);

  TempDir profile_;
  int pid_ = 0, to_ = -1, from_ = -1, id_ = 0;
  std::string session_, received_;
};

std::string FromBase64(const std::string& base64);
