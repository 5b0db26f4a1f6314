// embedded: a page within another page, as a notebook has it.  Both sides send {shapeshift: LINK}
// by postMessage, where LINK is what link.js writes: what is told is what an address may say.

/** Into the address, where there is one, and to the page around this one. @param {string} link */
export function keepLink(link) {
    try {
        history.replaceState(null, "", link);
    } catch {
        // a frame of a notebook has no address of its own
    }
    if (parent !== window) parent.postMessage({ shapeshift: link }, "*");
}

/** Hears what the page around this one says, and nobody else. @param {(link: string) => void} follow */
export function followParent(follow) {
    addEventListener("message", ({ data, source }) => {
        if (source === parent && parent !== window && typeof data?.shapeshift === "string") follow(data.shapeshift.slice(0, 4000));
    });
}
