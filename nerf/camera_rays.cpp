namespace nerf {}
