// The decoder of a page that holds its model.

import { answer, listen } from "./answers.js";

/** Answers one message of the page. */
export function handle(message) {
  return answer(message);
}

/** In a worker: answers all messages of the page. */
export function serve(scope) {
  listen(scope);
}
