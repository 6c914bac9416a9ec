namespace sfm {}
