// The page's other way of blending: see page.js.
import "/page.js";
