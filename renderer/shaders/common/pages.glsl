// pages: the last rows of a frame are drawn from pages of an arena, each for an object of its own;
// several may show the same page.  Nothing without PAGED.
// Reads:   pages (buffers.py): poses of all objects, and from first_entry on a uvec4 a page of
//          PAGE splats: arena row, or NO_PAGE; where its object's pose begins; part; antialiased.
// Defines: Page page_of(i): of splat i of the paged rows.
// Units:   a part of a splat: 1 where all of it is drawn.
#ifndef PAGED
#define PAGED 0  // 1: the rows are drawn from pages, each for an object of its own
#endif
#if PAGED
layout(std430, binding = SLOT_PAGES) readonly buffer Pages { uvec4 pages[]; };
uniform uint first_entry;
const uint NO_PAGE = 0xFFFFFFFFu;

struct Page {
    bool there;
    uint row;   // of the arena: where the splat lies
    uint pose;  // the first of its object's vec4
    float part;
    bool antialiased;
};

Page page_of(uint i) {
    uvec4 entry = pages[first_entry + i / PAGE];
    bool there = entry.x != NO_PAGE;
    // Row 0 is one that is read in vain, but never past the end.
    uint row = there ? entry.x + i % PAGE : 0u;
    return Page(there, row, entry.y, uintBitsToFloat(entry.z), entry.w != 0u);
}

vec4 pose_row(uint at) { return uintBitsToFloat(pages[at]); }
#endif
