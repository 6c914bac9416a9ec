// The field's numbers: compressed in the page's text, since a page from disk may not read other files.

async function unpack(base64) {
  const pieces = 4 << 16;  // letters decoded at once: a whole number of fours
  let at = 0;
  const compressed = new ReadableStream({
    pull(controller) {
      const letters = atob(base64.slice(at, at += pieces)), bytes = new Uint8Array(letters.length);
      for (let i = 0; i < letters.length; ++i) bytes[i] = letters.charCodeAt(i);
      if (bytes.length > 0) controller.enqueue(bytes);
      if (at >= base64.length) controller.close();
    },
  });
  return new Uint8Array(await new Response(compressed.pipeThrough(new DecompressionStream('gzip'))).arrayBuffer());
}

// {description: sizes, scales and space; weights, table, march, trained: see field_payload.h; splats: null or
// {description, texels}, see splat_payload.h}
async function loadField() {
  const description = JSON.parse(byId('field').textContent);
  const bytes = await unpack(byId('field-bytes').textContent.trim());
  const part = ([at, size]) => bytes.subarray(at, at + size);
  const { weights, table, march, trained, splats, shares } = description.parts;
  const texels = splats && new Uint32Array(bytes.buffer, splats[0], splats[1] / 4);
  return { splats: splats ? { description: description.splats, texels } : null,
    description, weights: new Float32Array(bytes.buffer, weights[0], weights[1] / 4), table: part(table),
    march: part(march), trained: part(trained), shares: shares && part(shares) };
}
