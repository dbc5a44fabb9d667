// Text that was packed into the page, see `skred.report.shared.programs.packed`.
"use strict";
window.skredUnpack = async (packed) => {
  const bytes = Uint8Array.from(atob(packed), (character) => character.charCodeAt(0));
  const plain = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(plain).text();
};
