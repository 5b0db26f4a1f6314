// served: a page of `launch.py serve` loads itself anew when its scene has changed; the address
// holds camera and x, so that both stay.
const ASK_MS = 1000;

/** Asks on while the server answers. @param {() => void} beforehand  what is done before the page is loaded anew */
export function followServer(beforehand) {
    const { served } = document.documentElement.dataset;
    if (!served) return;
    const ask = async () => {
        const answer = await fetch("version", { cache: "no-store" }).catch(() => null), version = answer?.ok ? await answer.text() : served;
        if (version === served) setTimeout(ask, ASK_MS);
        else {
            beforehand();
            location.reload();
        }
    };
    setTimeout(ask, ASK_MS);
}
