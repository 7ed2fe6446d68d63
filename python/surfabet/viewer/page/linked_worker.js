// The decoder of a page that lies beside its model, and reads the parts of it that are shown.

import { SfbError } from "../decoder/bytes.js";
import { openLinked } from "../decoder/linked.js";
import { answer, listen, openBy } from "./answers.js";

/** Bytes of a file on a server, from `start` up to `end`, and the size of the file. */
function rangesOf(url) {
  let whole = null;
  return async (start, end) => {
    if (whole) return { bytes: whole.subarray(start, end), size: whole.length };
    const name = decodeURIComponent(url.split("/").at(-1));
    let response;
    try {
      response = await fetch(url, { headers: { Range: `bytes=${start}-${end - 1}` } });
    } catch {
      throw new SfbError(`${name} cannot be read: open this page through a web server, with ${name} where it was when the page was written`);
    }
    if (!response.ok) throw new SfbError(`${name} cannot be read: the server says ${response.status} ${response.statusText}`);
    const bytes = new Uint8Array(await response.arrayBuffer());
    // A server without ranges gives all that it has.
    if (response.status !== 206) {
      whole = bytes;
      return { bytes: whole.subarray(start, end), size: whole.length };
    }
    const size = Number(/\/(\d+)$/.exec(response.headers.get("Content-Range") ?? "")?.[1]);
    if (!(size > 0)) throw new SfbError(`the server does not say how large ${name} is`);
    return { bytes, size };
  };
}

openBy((url) => openLinked(rangesOf(url)));

/** Answers one message of the page. */
export function handle(message) {
  return answer(message);
}

/** In a worker: answers all messages of the page. */
export function serve(scope) {
  listen(scope);
}
